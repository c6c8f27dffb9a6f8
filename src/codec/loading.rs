//! A file in memory that is read in steps, so that a program with one thread, such as a page in a browser, can draw and
//! answer between two steps.
//!
//! In: the name and the bytes of a file, [`ReadOptions`], and other files of its folder when they are asked for. Out:
//! after some steps, a [`RuntimeScene`]. Packages are read in small steps, checkpoints and files of other makes in one;
//! all are converted for drawing in small steps.

use super::error::{CodecError, CodecErrorKind};
use super::found::Found;
use super::import::source::{Beside, checked, named};
use super::import::{Imported, sequence};
use super::input::Input;
use super::options::ReadOptions;
use super::package::{self, PackageError, Reading};
use super::read_frames;
use crate::scene::{ChunkTable, Conversion, GaussianScene, RuntimeScene};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A file that is being read.
///
/// A capture may consist of several files: the textures of a SOG, `cfg_args` of a checkpoint, the frames of a sequence
/// ([`ReadOptions::sequence`]), the index of a chunk file. [`wanted`](Self::wanted) names the next of them, and
/// [`supply`](Self::supply) takes it. A program that supplies none reads captures of a single file.
///
/// # Examples
///
/// ```
/// use bevy_gs4d::codec::{Loading, ReadOptions};
///
/// let bytes = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/toybox.gs4d"))?;
/// let mut loading = Loading::new("toybox.gs4d", bytes, &ReadOptions::default())?;
/// while loading.advance(Loading::STEP)? {
///     // A page draws here, and shows the progress.
///     assert!((0.0..=1.0).contains(&loading.progress()), "a part of the file");
/// }
/// let scene = loading.finish()?;
/// assert_eq!(scene.len(), 45_000, "all Gaussians");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Loading {
    path: PathBuf,
    options: ReadOptions,
    supplied: Supplied,
    /// The name of the file that the next step needs.
    wanted: Option<String>,
    lost: Vec<String>,
    state: State,
}

enum State {
    Package(Box<Reading<Cursor<Vec<u8>>>>),
    /// A file that is read in one step.
    Whole(Box<Found<'static>>),
    /// The names and the bytes of the frames of a sequence, which are read in one step.
    Frames(Vec<(String, Vec<u8>)>),
    Converting(Box<Conversion>),
    /// A step has failed.
    Failed,
}

impl Loading {
    /// Bytes of a step that is short on every machine: about two milliseconds on a slow one.
    pub const STEP: usize = 1 << 16;

    /// Recognizes the format of a file by its contents, or by the extension of its name, and reads the header of a
    /// package.
    ///
    /// # Errors
    /// Bytes of an unknown format; a damaged header; options that are invalid.
    pub fn new(name: impl AsRef<Path>, bytes: Vec<u8>, options: &ReadOptions) -> Result<Self, CodecError> {
        let (path, supplied) = (name.as_ref().to_owned(), Supplied::default());
        let state = State::of(&path, bytes, options, &supplied);
        let state = state.map_err(|kind| CodecError::at(&path, kind))?;
        let wanted = match &state {
            State::Frames(frames) => frames.last().and_then(|(name, _)| sequence::next(name)),
            State::Package(reading) if reading.needs_codebooks() && options.codebooks.is_none() => {
                Some(ChunkTable::INDEX.to_owned())
            }
            _ => None,
        };
        let lost = if state.is_native() { options.without_effect() } else { None };
        Ok(Self { path, options: options.clone(), supplied, wanted, lost: lost.into_iter().collect(), state })
    }

    /// As [`new`](Self::new), of an index that chunk files follow in one file
    /// ([`Following::From`](package::Following::From)). `bytes` are those before the first of these. The scene is the
    /// index, whose table says where the files are ([`ChunkTable::range`]).
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_index(name: impl AsRef<Path>, bytes: Vec<u8>, options: &ReadOptions) -> Result<Self, CodecError> {
        let path = name.as_ref().to_owned();
        let state = State::of_index(bytes, options).map_err(|kind| CodecError::at(&path, kind))?;
        let lost = options.without_effect().into_iter().collect();
        Ok(Self { path, options: options.clone(), supplied: Supplied::default(), wanted: None, lost, state })
    }

    /// Does one step towards a scene that can be drawn. A step of a package or of the conversion reads, decompresses,
    /// stores or converts about `bytes` at most. Returns whether there is more to do.
    ///
    /// A file that is [wanted](Self::wanted) and was not supplied counts as missing.
    ///
    /// # Errors
    /// As [`load`](super::load); a Gaussian that cannot be drawn. After an error, every further step is one.
    pub fn advance(&mut self, bytes: usize) -> Result<bool, CodecError> {
        self.step(bytes).map_err(|kind| CodecError::at(&self.path, kind))
    }

    fn step(&mut self, bytes: usize) -> Result<bool, CodecErrorKind> {
        if self.wanted.is_some() {
            self.supply(Err(io::Error::new(io::ErrorKind::NotFound, "there is no such file")));
        }
        self.state = match std::mem::replace(&mut self.state, State::Failed) {
            State::Package(mut reading) => {
                if reading.advance(bytes)? {
                    State::Package(reading)
                } else {
                    State::converting(package::finish_beside(*reading, &self.supplied, &self.options)?)?
                }
            }
            State::Whole(found) => self.read_whole(found)?,
            State::Frames(frames) => {
                let Imported { scene, lost } = read_frames(frames, &self.options)?;
                self.lost.extend(lost);
                State::converting(scene)?
            }
            State::Converting(mut conversion) => {
                let is_more = conversion.advance(bytes)?;
                self.state = State::Converting(conversion);
                return Ok(is_more);
            }
            State::Failed => return Err(failed()),
        };
        Ok(true)
    }

    /// Reads a file, unless its reader asks for other files that were not supplied yet: then the step after all of them
    /// begins anew.
    fn read_whole(&mut self, mut found: Box<Found<'static>>) -> Result<State, CodecErrorKind> {
        let read = found.read(&self.options);
        self.wanted = self.supplied.take_wanted();
        if self.wanted.is_some() {
            return Ok(State::Whole(found));
        }
        let Imported { scene, lost } = read?;
        self.lost.extend(lost);
        State::converting(scene)
    }

    /// Returns the name of a file that the next step needs, relative to the folder of the file.
    pub fn wanted(&self) -> Option<&str> {
        self.wanted.as_deref()
    }

    /// Supplies the bytes of the file that is [wanted](Self::wanted), or the reason why there are none. The reader
    /// decides whether it can do without the file. No effect if no file is wanted.
    pub fn supply(&mut self, file: io::Result<Vec<u8>>) {
        let Some(name) = self.wanted.take() else { return };
        match (&mut self.state, file) {
            (State::Frames(frames), Ok(bytes)) => {
                self.wanted = sequence::next(&name);
                frames.push((name, bytes));
            }
            // The sequence ends with the frame before.
            (State::Frames(_), Err(_)) => {}
            (_, file) => {
                self.supplied.supply(name, file);
                self.wanted = self.supplied.take_wanted();
            }
        }
    }

    /// Returns the part of the file that has been read, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.state {
            State::Package(reading) => reading.progress(),
            State::Whole(_) | State::Frames(_) => 0.0,
            State::Converting(_) | State::Failed => 1.0,
        }
    }

    /// Returns what of the file the scene does not show, or shows approximately, and which options have no effect: one
    /// sentence each. Complete once the file has been read.
    pub fn lost(&self) -> &[String] {
        &self.lost
    }

    /// Does all remaining steps, and returns the scene that can be drawn.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn finish(mut self) -> Result<RuntimeScene, CodecError> {
        while self.advance(usize::MAX)? {}
        let Self { path, state, .. } = self;
        let scene = match state {
            State::Converting(conversion) => conversion.finish().map_err(CodecErrorKind::from),
            _ => Err(failed()),
        };
        scene.map_err(|kind| CodecError::at(&path, kind))
    }
}

fn failed() -> CodecErrorKind {
    io::Error::other("a step before has failed").into()
}

impl State {
    fn of(path: &Path, bytes: Vec<u8>, options: &ReadOptions, supplied: &Supplied) -> Result<Self, CodecErrorKind> {
        if options.sequence {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            return Ok(Self::Frames(vec![(name, bytes)]));
        }
        if bytes.starts_with(&package::MAGIC) {
            options.check().map_err(PackageError::from)?;
            return Ok(Self::Package(Box::new(Reading::new(Cursor::new(bytes))?)));
        }
        Ok(Self::Whole(Box::new(Found::of(Input::of(bytes), path, Box::new(supplied.clone()))?)))
    }

    fn of_index(bytes: Vec<u8>, options: &ReadOptions) -> Result<Self, CodecErrorKind> {
        options.check().map_err(PackageError::from)?;
        let length = bytes.len() as u64;
        Ok(Self::Package(Box::new(Reading::of_index(Cursor::new(bytes), length)?)))
    }

    /// Begins to convert a scene.
    fn converting(scene: GaussianScene) -> Result<Self, CodecErrorKind> {
        Ok(Self::Converting(Box::new(Conversion::of(scene)?)))
    }

    /// Returns whether the file is a package or a checkpoint.
    fn is_native(&self) -> bool {
        match self {
            Self::Package(_) => true,
            Self::Whole(found) => ["checkpoint", "package"].contains(&found.format.id),
            Self::Frames(_) | Self::Converting(_) | Self::Failed => false,
        }
    }
}

/// Other files of the folder, by the names by which a reader has asked for them.
#[derive(Clone, Default)]
struct Supplied(Arc<Mutex<SuppliedFiles>>);

#[derive(Default)]
struct SuppliedFiles {
    /// The bytes of each file, or why there are none.
    known: BTreeMap<String, Result<Vec<u8>, (io::ErrorKind, String)>>,
    /// The files that a reader has asked for and that are not known, in its order.
    wanted: VecDeque<String>,
}

impl Supplied {
    fn files(&self) -> MutexGuard<'_, SuppliedFiles> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores a file. After one that is missing the reader decides anew which others it needs.
    fn supply(&self, name: String, file: io::Result<Vec<u8>>) {
        let file = file.map_err(|error| (error.kind(), error.to_string()));
        let mut files = self.files();
        if file.is_err() {
            files.wanted.clear();
        }
        files.known.insert(name, file);
    }

    fn take_wanted(&self) -> Option<String> {
        self.files().wanted.pop_front()
    }
}

impl Beside for Supplied {
    /// As its trait says; a file that is not known is an error of the kind `WouldBlock`.
    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let name = checked(name)?;
        let mut files = self.files();
        let error = match files.known.get(name) {
            Some(Ok(bytes)) => return Ok(bytes.clone()),
            Some(Err((kind, reason))) => io::Error::new(*kind, reason.clone()),
            None => {
                if files.wanted.is_empty() {
                    files.wanted.push_back(name.to_owned());
                }
                not_supplied()
            }
        };
        Err(named(name, error))
    }

    /// Returns whether the file was supplied: a file is not asked for only to know whether there is one.
    fn has(&self, name: &str) -> bool {
        checked(name).is_ok_and(|name| matches!(self.files().known.get(name), Some(Ok(_))))
    }

    /// As its trait says; files that are not known are an error of the kind `WouldBlock`, unless one of the others is
    /// missing.
    fn announce(&self, names: &[String]) -> io::Result<()> {
        let mut files = self.files();
        let mut unknown = Vec::new();
        for name in names {
            match files.known.get(checked(name)?) {
                Some(Ok(_)) => {}
                Some(Err((kind, reason))) => return Err(named(name, io::Error::new(*kind, reason.clone()))),
                None => unknown.push(name),
            }
        }
        let Some(first) = unknown.first() else { return Ok(()) };
        let error = named(first, not_supplied());
        let mut asked: BTreeSet<String> = files.wanted.iter().cloned().collect();
        files.wanted.extend(unknown.into_iter().filter(|name| asked.insert((*name).clone())).cloned());
        Err(error)
    }
}

fn not_supplied() -> io::Error {
    io::Error::new(io::ErrorKind::WouldBlock, "it has not been supplied yet")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::export::exporter::Exporter;
    use crate::codec::export::table::Export;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{SceneForm, Trained, UpAxis};
    use serde_json::{Value, json};
    use std::io::Read;
    use zip::ZipArchive;

    const BUNDLED: &[u8] = include_bytes!("../../assets/toybox.gs4d");

    fn loading(bytes: &[u8]) -> Result<RuntimeScene, CodecError> {
        let mut loading = Loading::new("toybox.gs4d", bytes.to_vec(), &ReadOptions::default())?;
        let mut before = 0.0;
        while loading.advance(10_007)? {
            assert!(loading.progress() >= before, "the progress does not go back");
            before = loading.progress();
        }
        assert_eq!(loading.progress(), 1.0, "all has been read");
        loading.finish()
    }

    fn package_of(scene: &GaussianScene) -> Vec<u8> {
        let mut bytes = Vec::new();
        package::write(&mut bytes, scene, &package::WriteSettings::default()).expect("it can be written");
        bytes
    }

    #[test]
    fn a_package_that_is_read_in_steps_is_the_package() {
        let synth = |degree| synthesize(&SynthSettings { count: 3000, degree, ..SynthSettings::default() });
        let packages = [package_of(&synth(0)), package_of(&synth(3))];
        // Trained Gaussians, and packed ones with levels of detail.
        for bytes in packages.iter().map(Vec::as_slice).chain([BUNDLED]) {
            let loading = || Loading::new("it.gs4d", bytes.to_vec(), &ReadOptions::default()).expect("a package");
            let at_once = package::read(Cursor::new(bytes)).expect("it is intact").into_runtime().expect("drawable");
            for size in [1_000, 1 << 16, usize::MAX] {
                let (mut stepped, mut steps) = (loading(), 0);
                while stepped.advance(size).expect("it is intact") {
                    steps += 1;
                }
                assert!(steps > 10 || size > 1 << 16, "{steps} steps of {size} bytes");
                assert!(stepped.finish().expect("it is intact") == at_once, "every value is the same");
            }
            assert!(loading().finish().expect("it is intact") == at_once, "without a step, too");
        }
        assert_eq!(loading(BUNDLED).expect("it is intact").len(), 45_000, "with a progress that grows to 1");
    }

    #[test]
    fn options_replace_the_settings_of_a_package_and_those_without_an_effect_are_named() {
        let options = ReadOptions {
            up: Some(UpAxis::NegY),
            duration_seconds: Some(7.0),
            fps: Some(24.0),
            ..ReadOptions::default()
        };
        let mut loading = Loading::new("toybox.gs4d", BUNDLED.to_vec(), &options).expect("a package");
        while loading.advance(usize::MAX).expect("it is intact") {}
        assert!(loading.lost().iter().any(|sentence| sentence.contains("fps")), "{:?}", loading.lost());
        let playback = loading.finish().expect("it is intact").playback;
        assert_eq!((playback.up, playback.duration_seconds), (UpAxis::NegY, 7.0), "the options");
        let contradicting = ReadOptions { time_interval: Some([0.0, 99.0]), ..ReadOptions::default() };
        let loading = Loading::new("toybox.gs4d", BUNDLED.to_vec(), &contradicting).expect("a package");
        let refused = loading.finish().expect_err("the Gaussians are of another interval").to_string();
        assert!(refused.contains("time_interval"), "the option is named: {refused}");
    }

    /// A glTF file whose buffer is another file, and which shows no Gaussians.
    const NAMES_ANOTHER: &str = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "a%20b.bin", "byteLength": 4}],
        "meshes": [{"primitives": [{"extensions": {"KHR_gaussian_splatting": {}}}]}]}"#;

    #[test]
    fn other_files_are_asked_for_until_the_reader_has_them() {
        let begun = || {
            let bytes = NAMES_ANOTHER.as_bytes().to_vec();
            let mut loading = Loading::new("x/a.gltf", bytes, &ReadOptions::default()).expect("a glTF file");
            assert_eq!(loading.wanted(), None, "not before the first step");
            assert!(loading.advance(1).expect("a step that asks"), "there is more to do");
            assert_eq!(loading.wanted(), Some("a b.bin"), "the name in the folder of the file");
            loading
        };
        let message = |mut loading: Loading| loop {
            match loading.advance(1) {
                Ok(is_more) => assert!(is_more, "a file without Gaussians is refused"),
                Err(error) => break error.to_string(),
            }
        };
        let missing = message(begun());
        assert!(missing.contains("a b.bin") && missing.contains("no such file"), "not supplied: {missing}");
        let mut refused = begun();
        refused.supply(Err(io::Error::other("the server is down")));
        let refused = message(refused);
        assert!(refused.contains("a b.bin") && refused.contains("the server is down"), "the reason: {refused}");
        let mut supplied = begun();
        supplied.supply(Ok(vec![0; 4]));
        assert_eq!(supplied.wanted(), None, "it is supplied");
        let supplied = message(supplied);
        assert!(!supplied.contains("a b.bin"), "the file is there, and has no Gaussians: {supplied}");
    }

    /// The files of a SOG at one time, by their names.
    fn sog() -> Vec<(String, Vec<u8>)> {
        let scene = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
        let exporter = Exporter::new(scene, Export::of_id("sog").expect("a format"), 30.0).expect("it can be exported");
        let mut bytes = Vec::new();
        exporter.write(0.5, &mut bytes).expect("memory can be written to");
        let mut zip = ZipArchive::new(Cursor::new(bytes)).expect("an archive");
        let count = zip.len();
        let file = |index| {
            let mut file = zip.by_index(index).expect("an entry");
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).expect("intact");
            (file.name().expect("a name").into_owned(), bytes)
        };
        (0..count).map(file).collect()
    }

    #[test]
    fn the_parts_of_a_streamed_sog_are_decoded_once_whatever_their_number() {
        let files = sog();
        let meta = &files.iter().find(|(name, _)| name == "meta.json").expect("is there").1;
        let meta: Value = serde_json::from_slice(meta).expect("JSON");
        let read = |parts: usize| {
            let part = |part: usize| files.iter().map(move |(name, bytes)| (format!("0_{part}/{name}"), bytes.clone()));
            let files: BTreeMap<String, Vec<u8>> = (0..=parts).flat_map(part).collect();
            let names: Vec<String> = (0..parts).map(|part| format!("0_{part}/meta.json")).collect();
            let chunk = |file: usize| json!({"lods": {"0": {"file": file, "offset": 0, "count": meta["count"]}}});
            let lod = json!({
                "lodLevels": 1, "filenames": names, "environment": format!("0_{parts}/meta.json"),
                "tree": {"children": (0..parts).map(chunk).collect::<Vec<Value>>()},
            });
            let bytes = lod.to_string().into_bytes();
            let mut loading = Loading::new("x/lod-meta.json", bytes, &ReadOptions::default()).expect("a streamed SOG");
            let (mut steps, mut supplied) = (0, 0);
            loop {
                if let Some(name) = loading.wanted() {
                    let file = files.get(name).cloned();
                    loading.supply(file.ok_or_else(|| io::Error::from(io::ErrorKind::NotFound)));
                    supplied += 1;
                } else if loading.advance(usize::MAX).expect("all files are there") {
                    steps += 1;
                } else {
                    break;
                }
            }
            assert_eq!(supplied, files.len(), "each file is asked for once");
            (steps, loading.finish().expect("it can be drawn").len())
        };
        let (few, many) = (read(1), read(12));
        assert_eq!(few.1 / 2 * 13, many.1, "all Gaussians, and the surroundings");
        assert!(few.1 > 0 && few.0 == many.0, "{} steps of 1 file, {} of 12", few.0, many.0);
    }

    #[test]
    fn a_file_that_is_missing_ends_the_requests_of_its_level() {
        let lod = json!({
            "lodLevels": 2, "filenames": ["0_0/meta.json", "0_1/meta.json", "1_0/meta.json"],
            "tree": {"children": [
                {"lods": {"0": {"file": 0, "offset": 0, "count": 9}, "1": {"file": 2, "offset": 0, "count": 1}}},
                {"lods": {"0": {"file": 1, "offset": 0, "count": 9}, "1": {"file": 2, "offset": 1, "count": 1}}},
            ]},
        });
        let bytes = lod.to_string().into_bytes();
        let mut loading = Loading::new("lod-meta.json", bytes, &ReadOptions::default()).expect("a streamed SOG");
        for expected in ["0_0/meta.json", "1_0/meta.json"] {
            assert!(loading.advance(1).expect("a step that asks"), "there is more to do");
            assert_eq!(loading.wanted(), Some(expected), "the first file of a level");
            loading.supply(Err(io::Error::from(io::ErrorKind::NotFound)));
            assert_eq!(loading.wanted(), None, "no others of this level");
        }
        let message = loading.advance(1).expect_err("no level is there").to_string();
        assert!(message.contains("0_0/meta.json") && message.contains("1_0/meta.json"), "{message}");
    }

    #[test]
    fn frames_are_asked_for_until_one_is_missing() {
        let options = ReadOptions { sequence: true, fps: Some(2.0), ..ReadOptions::default() };
        let frame = || b"ply\nformat ascii 1.0\nend_header\n".to_vec();
        let mut loading = Loading::new("clip/f_9.ply", frame(), &options).expect("it is not looked at yet");
        for expected in ["f_10.ply", "f_11.ply"] {
            assert_eq!(loading.wanted(), Some(expected), "the next frame");
            loading.supply(Ok(frame()));
        }
        loading.supply(Err(io::Error::other("it is not there")));
        assert_eq!(loading.wanted(), None, "the sequence ends");
        let message = loading.advance(1).expect_err("frames without Gaussians").to_string();
        assert!(message.contains("f_9.ply"), "the first frame is refused by its name: {message}");
    }

    #[test]
    fn a_gaussian_that_cannot_be_drawn_is_named_when_it_is_converted() {
        let mut scene = synthesize(&SynthSettings { count: 3000, ..SynthSettings::default() });
        let SceneForm::Trained(Trained { parameters, .. }) = &mut scene.form else { panic!("a trained scene") };
        parameters.rotation_l[2100] = [0.0; 4];
        let mut loading = Loading::new("it.gs4d", package_of(&scene), &ReadOptions::default()).expect("a package");
        let refused = loop {
            match loading.advance(1 << 14) {
                Ok(is_more) => assert!(is_more, "it is refused"),
                Err(error) => break error.to_string(),
            }
        };
        assert!(refused.starts_with("it.gs4d: Gaussian 2100: "), "{refused}");
        assert!(loading.advance(1).is_err() && loading.finish().is_err(), "it stays refused");
    }

    #[test]
    fn a_damaged_file_is_refused_with_its_name() {
        let mut damaged = BUNDLED.to_vec();
        let last = damaged.len() - 1;
        damaged[last] ^= 1;
        for (bytes, expected) in [(&damaged[..], "checksum"), (&BUNDLED[..9_000], "cut off"), (b"other", "neither")] {
            let message = loading(bytes).expect_err("it is refused").to_string();
            assert!(message.starts_with("toybox.gs4d: ") && message.contains(expected), "{message}");
        }
    }
}
