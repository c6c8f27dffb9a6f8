//! Settings of a bake.
//!
//! In: paths, goals and choices of the user. Out: [`BakeSettings`], whose files can be checked before anything is
//! computed.

use crate::codec::CodecError;
use crate::codec::sound::read_sound;
use crate::offline::collide::CollideSettings;
use crate::offline::compress::{PackedOrder, Quality};
use crate::offline::dataset::splits::SplitOptions;
use crate::offline::filter::temporal_filter::KeyFrames;
use crate::offline::prune::search::{Goal, ScoreChoice};
use crate::offline::report::report_paths;
use crate::offline::score::ScoringSettings;
use crate::offline::store::outputs::Files;
use crate::offline::train::FineTuneSettings;
use crate::offline::work::FileError;
use crate::scene::{FilterKind, SoundFile};
use std::path::PathBuf;
use std::sync::Arc;

/// Settings of a bake.
#[derive(Debug, Clone, PartialEq)]
pub struct BakeSettings {
    /// The file that the scene was read from. Results of an earlier bake are reused only if it has not changed.
    pub checkpoint: PathBuf,
    /// Folder of the dataset, with `transforms_train.json`. The report compares test views if there is a
    /// `transforms_test.json`.
    pub data: PathBuf,
    /// How the views are read and divided.
    pub splits: SplitOptions,
    /// The package to write; must not be the checkpoint.
    pub out: PathBuf,
    /// Background, RGB, 0 to 1; `None` uses the background that the capture was trained with.
    pub background: Option<[f32; 3]>,
    /// How many Gaussians to keep.
    pub goal: Goal,
    /// Rounds of pruning, with training between the rounds if the Gaussians are trained; 1 removes all at once.
    pub rounds: usize,
    /// Which score to prune by.
    pub score: ScoreChoice,
    /// Settings of the scoring.
    pub scoring: ScoringSettings,
    /// Kind of the temporal filter.
    pub filter: FilterKind,
    /// Number of key-frames of the filter.
    pub key_frames: KeyFrames,
    /// How the remaining Gaussians are trained, if there is a GPU and the images of the training views exist; `None`
    /// leaves training out. An interrupted training resumes from its last evaluation; the training of codebooks, from a
    /// multiple of as many steps.
    pub fine_tune: Option<FineTuneSettings>,
    /// The quality of the compressed capture.
    pub quality: Quality,
    /// The order of the Gaussians of the package.
    pub order: PackedOrder,
    /// zstd level of the package, 1 (fast) to 19 (small); `None` uses the default of `write_settings`.
    pub level: Option<i32>,
    /// How colliders are made, from the packed Gaussians; `None` keeps those of the checkpoint, if there are any.
    pub colliders: Option<CollideSettings>,
    /// The sound file that the package carries; `None` keeps that of the checkpoint.
    pub audio: Option<PathBuf>,
    /// Whether images are used without a check that they show the capture.
    pub trust_images: bool,
    /// Whether to keep the folder `OUT.bake` after the bake.
    pub keep_work: bool,
}

impl BakeSettings {
    /// Reads the sound file that the package carries; `None` if it keeps that of the checkpoint.
    ///
    /// # Errors
    /// A file that cannot be read, or that is no sound that can be played.
    pub fn sound(&self) -> Result<Option<Arc<SoundFile>>, CodecError> {
        let read = self.audio.as_deref().map(read_sound).transpose()?;
        Ok(read.map(|(file, _)| Arc::new(file)))
    }

    /// Checks that the package and the reports can be written and are none of the files that are read.
    /// [`bake`](super::bake()) checks this, too; a program can call this function before it reads a large checkpoint.
    ///
    /// # Errors
    /// The first output that cannot be written or is an input.
    pub fn check_files(&self) -> Result<(), FileError> {
        let files = Files::default().reads_scene(&self.checkpoint).reads_data(&self.data).reads(&self.audio);
        let files = files.writes_regular(&self.out, "gs4d");
        let [json, html] = report_paths(&self.out);
        files.writes_regular(&json, "json").writes_regular(&html, "html").check()
    }
}
