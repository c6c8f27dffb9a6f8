//! `gs4d sound SCENE SOUND -o OUT`: puts a sound file into a capture, takes it out, or removes it.
//!
//! In: a capture; a sound file in Ogg Vorbis or WAV. Out: a package that carries the file, or that carries none any
//! more; or the file that a package carries, byte for byte.

use crate::cli::args::{CheckpointArgs, file_size};
use crate::cli::output::failure::Failure;
use crate::cli::output::note::note;
use crate::cli::output::report::Report;
use crate::cli::output::table::{bytes, lines};
use crate::codec::sound::{Sound, read_sound};
use crate::offline::store::outputs::Files;
use crate::offline::work::{save, write_beside, write_settings};
use crate::scene::{GaussianScene, SoundFile};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Put a sound file into a capture, so that a game plays it beside the picture.
///
/// The sound begins with the first moment of the capture. A sound that SCENE carries is replaced; what is drawn does
/// not change.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d sound singer.gs4d take.ogg -o with-sound.gs4d
  gs4d sound with-sound.gs4d --extract take.ogg
  gs4d sound with-sound.gs4d --remove -o singer.gs4d --json

Ogg Vorbis and WAV with one or two channels are read. Others are converted, as by: ffmpeg -i take.mp4 -vn -ac 2 take.ogg
In Bevy, a CaptureSound on the entity of the capture plays it.")]
pub(crate) struct SoundVerb {
    /// The package, or a capture of any other format. It stays as it is.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The sound file.
    #[arg(value_name = "SOUND", required_unless_present_any = ["extract", "remove"])]
    sound: Option<PathBuf>,
    /// The package to write (.gs4d). An existing file is replaced when the new one is complete.
    #[arg(short, long, value_name = "OUT", required_unless_present = "extract")]
    out: Option<PathBuf>,
    /// Write the sound file that SCENE carries to this file instead.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sound", "out", "remove"])]
    extract: Option<PathBuf>,
    /// Remove the sound instead.
    #[arg(long, conflicts_with = "sound")]
    remove: bool,
}

impl SoundVerb {
    /// Puts, takes or removes the sound.
    ///
    /// # Errors
    /// A capture or a sound that cannot be read, no sound to take or to remove, files that cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let files = Files::default().reads_scene(&self.scene).reads(&self.sound);
        let files = self.out.iter().fold(files, |files, out| files.writes_regular(out, "gs4d"));
        let is_wave = |path: &Path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("wav"));
        let extension = if self.extract.as_deref().is_some_and(is_wave) { "wav" } else { "ogg" };
        self.extract.iter().fold(files, |files, file| files.writes(file, extension)).check()?;
        let before = file_size(&self.scene)?;
        // A sound that cannot be used is refused before a large capture is read.
        let read = self.sound.as_deref().map(read_sound).transpose()?;
        let mut scene = CheckpointArgs::default().load(&self.scene)?;
        let (action, file) = match read {
            Some((file, sound)) => {
                note_length(&sound, scene.playback.duration_seconds);
                let file = Arc::new(file);
                scene.sound = Some(file.clone());
                (self.described(&sound), file)
            }
            None => {
                let missing = || Failure::about(&self.scene, "carries no sound");
                ("removed".to_owned(), scene.sound.take().ok_or_else(missing)?)
            }
        };
        match (&self.extract, &self.out) {
            (Some(path), _) => self.take(path, &file),
            (None, Some(out)) => self.put(out, &scene, action, &file, before),
            (None, None) => Err(Failure::new("give OUT, the package to write")),
        }
    }

    /// Returns the kind of a sound, for people.
    fn described(&self, sound: &Sound) -> String {
        let channels = if sound.channels() == 1 { "one channel" } else { "two channels" };
        format!("{:.2} s, {} Hz, {channels}", sound.seconds(), sound.rate())
    }

    /// Writes the file of the sound.
    fn take(&self, path: &Path, file: &SoundFile) -> Result<Report, Failure> {
        let [own, other] = if file.bytes().starts_with(b"RIFF") { ["wav", "ogg"] } else { ["ogg", "wav"] };
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(other)) {
            return Err(Failure::about(path, &format!("would be a sound of another kind: name it .{own}")));
        }
        write_beside(path, |writer| writer.write_all(file.bytes()))?;
        let length = file.bytes().len() as u64;
        let json = json!({
            "scene": self.scene.display().to_string(),
            "extracted": path.display().to_string(),
            "bytes_sound": length,
        });
        Ok(Report::new(json, lines(&[("wrote", format!("{}, {}", path.display(), bytes(length)))])))
    }

    /// Writes the package.
    fn put(
        &self,
        out: &Path,
        scene: &GaussianScene,
        action: String,
        file: &SoundFile,
        before: u64,
    ) -> Result<Report, Failure> {
        save(out, scene, &write_settings(&scene.form, None))?;
        let after = file_size(out)?;
        let json = json!({
            "scene": self.scene.display().to_string(),
            "out": out.display().to_string(),
            "removed": self.remove,
            "bytes_in": before,
            "bytes_out": after,
            "bytes_sound": file.bytes().len(),
        });
        let pairs = [
            ("sound", format!("{action}, {}", bytes(file.bytes().len() as u64))),
            ("wrote", format!("{}, {} (from {})", out.display(), bytes(after), bytes(before))),
        ];
        Ok(Report::new(json, lines(&pairs)))
    }
}

/// Notes a sound that is not as long as its capture, which plays for `seconds`.
pub(super) fn note_length(sound: &Sound, seconds: f32) {
    let (own, other) = (sound.seconds(), f64::from(seconds));
    if other == 0.0 {
        note("note: the capture is a still: nothing of the sound is heard");
    } else if (own - other).abs() > 0.1 {
        let end = if own > other { "its end is not heard" } else { "the end of the capture is silent" };
        note(&format!("note: the sound lasts {own:.2} s and the capture {other:.2} s: {end}"));
    }
}
