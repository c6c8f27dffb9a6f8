//! The readers, and how their inputs are made.
//!
//! In: random numbers. Out: the bytes of a file for one reader, and what became of them. `KINDS` lists the readers.
//!
//! Two are not here: timelines (`*.timeline.ron`), which only a Bevy app can load, and the state of fine-tuning, which needs a GPU. Both are
//! RON or bytes behind a checksum, whose tests are `plugin/playback/timeline/file.rs` and `offline/work.rs`.

mod cameras;
mod checkpoint;
mod package;
mod pictures;
mod saved;
mod scores;
mod settings;

use crate::support::random::Random;
use std::sync::Arc;

/// What became of an input.
#[derive(Debug)]
pub enum Outcome {
    /// It was refused, with this message.
    Refused(String),
    /// It was accepted.
    Accepted,
    /// It was accepted and drawn.
    Drawn,
}

/// A reader with its seeds.
pub trait Reader: Send + Sync {
    /// Makes an input.
    fn input(&self, random: &mut Random) -> Vec<u8>;

    /// Reads an input.
    ///
    /// # Errors
    /// A defect: what was accepted and should not have been.
    fn read(&self, bytes: &[u8]) -> Result<Outcome, String>;
}

/// A reader to be made.
pub struct Kind {
    /// Its name, on the command line and of its folder in `tests/corpus/`.
    pub name: &'static str,
    /// What it reads.
    pub about: &'static str,
    /// Extension of its inputs.
    pub extension: &'static str,
    /// It takes each input whose number is a multiple of this: more than 1 where an input takes long.
    pub share: u64,
    /// Makes it.
    pub make: fn() -> Arc<dyn Reader>,
}

/// The readers.
pub static KINDS: [Kind; 9] = [
    Kind {
        name: "package",
        about: "packages (.gs4d) in every form, with filters and environment maps",
        extension: "gs4d",
        share: 1,
        make: || Arc::new(package::Packages::new()),
    },
    Kind {
        name: "checkpoint",
        about: "checkpoints (.pth) of every model: archive, pickle, tensors",
        extension: "pth",
        share: 1,
        make: || Arc::new(checkpoint::Checkpoints::new()),
    },
    Kind {
        name: "cameras",
        about: "camera files: transforms with a field of view or intrinsics, golden views",
        extension: "json",
        share: 1,
        make: || Arc::new(cameras::Cameras::new()),
    },
    Kind {
        name: "cfg-args",
        about: "cfg_args beside a checkpoint",
        extension: "txt",
        share: 1,
        make: || Arc::new(settings::CfgArgs::new()),
    },
    Kind {
        name: "options",
        about: "the options of a checkpoint in RON, as settings of Bevy's loader, on a checkpoint and a package",
        extension: "ron",
        share: 1,
        make: || Arc::new(settings::Options::new()),
    },
    Kind {
        name: "scores",
        about: "scores to prune by and weights of colors (.f32)",
        extension: "f32",
        share: 1,
        make: || Arc::new(scores::ScoreFiles::new()),
    },
    Kind {
        name: "pictures",
        about: "training images and masks (PNG, JPEG), in both modes, and their size",
        extension: "png",
        share: 1,
        make: || Arc::new(pictures::Pictures::new()),
    },
    Kind {
        name: "raw-pictures",
        about: "raw pictures (.f32) to compare",
        extension: "f32",
        share: 1,
        make: || Arc::new(pictures::RawPictures::new()),
    },
    Kind {
        name: "saved",
        about: "stored results of a bake, from which it goes on",
        extension: "saved",
        share: 10,
        make: || Arc::new(saved::Saved::new()),
    },
];
