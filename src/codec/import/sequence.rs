//! A sequence: one file of Gaussians at rest for each frame.
//!
//! In: the frames in order, or a folder of numbered PLY files. Out: one scene, in which a temporal filter shows the
//! Gaussians of one frame at a time. Every frame is exact; nothing is interpolated. A frame is shown until the next one
//! begins: the numbers in their names are times.

use super::assumed;
use super::columns::{Columns, Played, mip_filter_of};
use super::error::ImportError;
use super::imported::Imported;
use super::ply;
use crate::codec::hidden::is_hidden;
use crate::codec::input::read_regular;
use crate::codec::options::{FPS, InvalidOption, ReadOptions};
use crate::codec::text::printable;
use crate::gaussian::SMALLEST_CUTOFF;
use crate::scene::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter, UpAxis};
use std::ffi::OsStr;
use std::io;
use std::path::Path;

/// The names of the files of a sequence, for messages.
pub(crate) const NAMES: &str = "two or more files with the same beginning and a number before .ply or .compressed.ply (frame_0001.ply, frame_0002.ply)";

/// A frame: the name of its file, and a function that returns its bytes.
pub(crate) struct Frame<'a> {
    /// Name, for messages.
    pub name: String,
    /// Returns the bytes. It is called once, when all earlier frames are read.
    pub bytes: Box<dyn FnOnce() -> io::Result<Vec<u8>> + 'a>,
}

/// Returns whether files of these names are a sequence.
pub(crate) fn is_sequence(names: &[String]) -> bool {
    names.iter().filter(|name| number(name).is_some()).nth(1).is_some()
}

/// Reads the numbered PLY files of a folder as a sequence.
///
/// # Errors
/// A folder without such files, or with files of two sequences; as [`read`].
pub(crate) fn read_folder(folder: &Path, options: &ReadOptions) -> Result<Imported, ImportError> {
    let entries = folder.read_dir()?.collect::<io::Result<Vec<_>>>()?;
    let names = ordered(entries.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect())?;
    let frames = names.into_iter().map(|name| {
        let path = folder.join(&name);
        Frame { name, bytes: Box::new(move || read_regular(&path)) }
    });
    read(frames, options)
}

/// Reads frames, each of which is a PLY file of Gaussians at rest. A frame lasts until that of the next number, the
/// last one as long as one number. Frames without numbers follow one another.
///
/// # Errors
/// A frame that cannot be read, by name; more than 65 535 frames, none, invalid options.
pub(crate) fn read<'a>(
    frames: impl ExactSizeIterator<Item = Frame<'a>>,
    options: &ReadOptions,
) -> Result<Imported, ImportError> {
    options.check()?;
    let frames: Vec<Frame<'a>> = frames.collect();
    let Clock { starts, count, lost } = Clock::of(frames.iter().map(|frame| frame.name.as_str()))?;
    let duration_seconds = count as f32 / options.fps.unwrap_or(FPS);
    if !duration_seconds.is_normal() {
        let reason = format!("{count} frames last {duration_seconds} seconds");
        return Err(InvalidOption { name: "fps", reason }.into());
    }
    let (mut all, mut intervals, mut losses) = (Columns::with_capacity(0, 0), Vec::new(), Losses::default());
    let (mut origin, mut up, mut filtered) = (None, None, 0);
    let ends = starts.iter().skip(1).copied().chain([count]);
    for (frame, (&start, end)) in frames.into_iter().zip(starts.iter().zip(ends)) {
        let at = |error: ImportError| at(&frame.name, error);
        let bytes = (frame.bytes)().map_err(|error| at(error.into()))?;
        let mut lost = Vec::new();
        let (columns, own_up) = ply::still(&bytes, origin, &mut lost).map_err(at)?;
        losses.add(&frame.name, lost);
        intervals.resize(intervals.len() + columns.len(), start | (end - 1) << 16);
        // All frames are in the space of the first.
        origin = origin.or((columns.len() > 0).then_some(columns.origin));
        up = up.or(own_up);
        filtered += usize::from(columns.mip_filter);
        all.append(columns);
    }
    let (mip_filter, mixed) = mip_filter_of(filtered, starts.len(), "frames");
    (all.origin, all.mip_filter) = (origin.unwrap_or_default(), mip_filter);
    let sets = ActiveSets::Intervals(intervals);
    all.filter = Some(TemporalFilter { kind: FilterKind::Window, segments: count, count: all.len(), sets });
    let time_interval = [0.0, duration_seconds];
    let up = up.unwrap_or(UpAxis::NegY);
    let played = Played { up, time_interval, duration_seconds, marginal_cutoff: SMALLEST_CUTOFF };
    let speed = if count > 1 { assumed::speed(count, options) } else { None };
    let lost = lost.into_iter().chain(mixed).chain(losses.sentences()).chain(speed).collect();
    Ok(Imported { scene: all.into_scene(played, options)?, lost })
}

/// When frames begin, in frames after the first.
#[derive(Debug, PartialEq, Eq)]
struct Clock {
    /// The beginning of each frame.
    starts: Vec<u32>,
    /// The end of the last frame.
    count: u32,
    /// A sentence about numbers that are missing.
    lost: Option<String>,
}

impl Clock {
    /// Returns the times of the frames of these names.
    ///
    /// # Errors
    /// No frames, or more than 65 535.
    fn of<'n>(names: impl ExactSizeIterator<Item = &'n str>) -> Result<Self, ImportError> {
        let length = names.len();
        let files = u32::try_from(length)
            .ok()
            .filter(|count| (1..=MAX_SEGMENTS).contains(count))
            .ok_or_else(|| ImportError::unsupported(format!("has {length} frames; 1 to {MAX_SEGMENTS} can be read")))?;
        let one_by_one = |lost| Ok(Self { starts: (0..files).collect(), count: files, lost });
        let numbers: Option<Vec<u64>> = names.map(|name| number(name).map(|(_, number)| number)).collect();
        let Some(numbers) = numbers.filter(|numbers| numbers.is_sorted_by(|a, b| a < b)) else {
            return one_by_one(None);
        };
        let after_first = |number: &u64| number.saturating_sub(numbers.first().copied().unwrap_or(0));
        let last = numbers.last().map_or(0, after_first);
        let Some(count) = u32::try_from(last).ok().filter(|&last| last < MAX_SEGMENTS).map(|last| last + 1) else {
            return one_by_one(Some(format!(
                "The numbers of its {files} frames have a range of {last}, more than the {MAX_SEGMENTS} of a capture: the frames follow one another."
            )));
        };
        let starts: Vec<u32> = numbers.iter().map(|number| after_first(number) as u32).collect();
        let lost = (count > files).then(|| {
            let missing = count - files;
            format!("{missing} of {count} frames are missing: in place of each, the frame before it is shown.")
        });
        Ok(Self { starts, count, lost })
    }
}

/// Returns the error of a frame, with its name.
fn at(name: &str, error: ImportError) -> ImportError {
    let name = name.escape_debug();
    match error {
        ImportError::Io(error) => io::Error::new(error.kind(), format!("its file {name}: {error}")).into(),
        ImportError::Unsupported(reason) => ImportError::unsupported(format!("its file {name} {reason}")),
        error => ImportError::damaged(format!("its file {name} {error}")),
    }
}

/// Returns the name of the file that follows a frame: its number is one higher, with the same number of digits, or one
/// more after 9, 99 and so on. Returns `None` for a name without a number.
pub fn next(name: &str) -> Option<String> {
    let (beginning, number) = number(name)?;
    let ending = name.strip_prefix(beginning)?.trim_start_matches(|c: char| c.is_ascii_digit());
    let digits = name.len() - beginning.len() - ending.len();
    Some(format!("{beginning}{:0digits$}{ending}", number.checked_add(1)?))
}

/// Returns the beginning and the number of a name that a frame may have; a hidden file is none.
fn number(name: &str) -> Option<(&str, u64)> {
    if is_hidden(OsStr::new(name)) {
        return None;
    }
    let stem = without_ending(name, ".ply")?;
    let stem = without_ending(stem, ".compressed").unwrap_or(stem);
    let beginning = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    Some((beginning, stem.strip_prefix(beginning)?.parse().ok()?))
}

/// Returns a name without its ending, which is of upper or lower case; `None` if it ends otherwise.
fn without_ending<'n>(name: &'n str, ending: &str) -> Option<&'n str> {
    let (stem, own) = name.split_at_checked(name.len().checked_sub(ending.len())?)?;
    own.eq_ignore_ascii_case(ending).then_some(stem)
}

/// Returns the names of frames, by their numbers; other names are left out.
fn ordered(names: Vec<String>) -> Result<Vec<String>, ImportError> {
    let mut frames: Vec<(u64, String)> = names
        .into_iter()
        .filter_map(|name| number(&name).map(|(_, number)| number).map(|number| (number, name)))
        .collect();
    frames.sort();
    if frames.len() < 2 {
        return Err(ImportError::unsupported(format!("is a folder without a sequence: {NAMES}")));
    }
    for pair in frames.windows(2) {
        let [(first, a), (second, b)] = pair else { continue };
        let (a_shown, b_shown) = (a.escape_debug(), b.escape_debug());
        if number(a).map(|(beginning, _)| beginning) != number(b).map(|(beginning, _)| beginning) {
            let message =
                format!("has the frames of two sequences ({a_shown}, {b_shown}): move each into a folder of its own");
            return Err(ImportError::unsupported(message));
        }
        if first == second {
            let message = format!("has two files of frame {first} ({a_shown}, {b_shown}): keep one of them");
            return Err(ImportError::unsupported(message));
        }
    }
    Ok(frames.into_iter().map(|(_, name)| name).collect())
}

/// What frames lose: the sentences of the first frame that loses anything, and the number of such frames.
#[derive(Default)]
struct Losses {
    name: String,
    sentences: Vec<String>,
    frames: usize,
}

impl Losses {
    fn add(&mut self, name: &str, sentences: Vec<String>) {
        if sentences.is_empty() {
            return;
        }
        if self.frames == 0 {
            self.name = printable(name);
            self.sentences = sentences;
        }
        self.frames += 1;
    }

    fn sentences(self) -> Vec<String> {
        let others = match self.frames {
            0 | 1 => String::new(),
            frames => format!(" and {} other frames", frames - 1),
        };
        self.sentences.iter().map(|sentence| format!("{}{others}: {sentence}", self.name)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::ply::fixture::File;
    use super::*;
    use crate::scene::{Form, SceneForm};

    fn frames(files: &[(&str, Vec<u8>)]) -> Vec<Frame<'static>> {
        let frame = |(name, bytes): &(&str, Vec<u8>)| {
            let (name, bytes) = ((*name).to_owned(), bytes.clone());
            Frame { name, bytes: Box::new(move || Ok(bytes)) }
        };
        files.iter().map(frame).collect()
    }

    fn refusal(files: &[(&str, Vec<u8>)]) -> String {
        read(frames(files).into_iter(), &ReadOptions::default()).expect_err("the sequence is refused").to_string()
    }

    #[test]
    fn the_name_that_follows_a_frame_has_the_next_number() {
        for (name, expected) in [
            ("frame_0009.ply", Some("frame_0010.ply")),
            ("9.compressed.ply", Some("10.compressed.ply")),
            ("IMG_0009.PLY", Some("IMG_0010.PLY")),
            ("9.Compressed.Ply", Some("10.Compressed.Ply")),
            ("a1b099.ply", Some("a1b100.ply")),
            ("frame.ply", None),
            ("frame_1.spz", None),
            ("üü1", None),
        ] {
            assert_eq!(next(name).as_deref(), expected, "after {name}");
        }
    }

    #[test]
    fn each_frame_is_active_in_its_own_segment() {
        let files = [3, 0, 2].map(|count| ("", File::splats(count, if count == 2 { 9 } else { 0 }).little()));
        let options = ReadOptions { fps: Some(2.0), ..ReadOptions::default() };
        let scene = read(frames(&files).into_iter(), &options).expect("three frames").scene;
        assert_eq!(scene.trained_with.time_interval, [0.0, 1.5], "three frames at two a second");
        assert_eq!(scene.playback.duration_seconds, 1.5, "in seconds");
        let filter = scene.filter.as_ref().expect("a filter");
        assert_eq!(filter.active_counts(0..5), [3, 0, 2], "each frame has its own Gaussians");
        assert_eq!([0.1, 0.6, 1.5].map(|time| filter.segment_of(time, [0.0, 1.5])), [0, 1, 2], "frames in order");
        let SceneForm::Ready(Form::Sliced(sliced)) = &scene.form else { panic!("the sliced form") };
        let always =
            sliced.gaussians.iter().all(|gaussian| gaussian.sigma_t.is_infinite() && gaussian.velocity == [0.0; 3]);
        assert!(always, "Gaussians neither move nor fade");
        let (first, last) = (File::splats(3, 0), File::splats(2, 9));
        assert_eq!(sliced.harmonics.degree, 1, "the highest degree of color");
        assert_eq!(
            sliced.harmonics.of(2)[..3],
            ["f_dc_0", "f_dc_1", "f_dc_2"].map(|name| first.value(name, 2)),
            "colors"
        );
        assert_eq!(sliced.harmonics.of(2)[3..], [0.0; 9], "new coefficients are 0");
        assert_eq!(sliced.harmonics.of(4)[3], last.value("f_rest_0", 1), "coefficients of the last frame");
        assert_eq!(
            sliced.gaussians[4].mean,
            ["x", "y", "z"].map(|name| last.value(name, 1)),
            "means of the last frame"
        );
    }

    #[test]
    fn a_frame_is_shown_until_that_of_the_next_number() {
        let files = ["f3.ply", "f4.ply", "f7.ply"].map(|name| (name, File::splats(1, 0).little()));
        let options = ReadOptions { fps: Some(10.0), ..ReadOptions::default() };
        let Imported { scene, lost } = read(frames(&files).into_iter(), &options).expect("three frames");
        assert_eq!(scene.trained_with.time_interval, [0.0, 0.5], "numbers 3 to 7 at ten a second");
        let filter = scene.filter.as_ref().expect("a filter");
        let shown = |number: u32| {
            let segment = filter.segment_of((number as f32 + 0.5) / 10.0, [0.0, 0.5]);
            (0..3).filter(|&index| filter.is_active(segment, index)).collect::<Vec<_>>()
        };
        assert_eq!(
            [0, 1, 2, 3, 4].map(shown),
            [[0], [1], [1], [1], [2]],
            "the frame of each number, or the last before"
        );
        assert_eq!(lost, ["2 of 5 frames are missing: in place of each, the frame before it is shown."], "it is said");

        let far =
            ["f1700000000.ply", "f1700000033.ply", "f1700099000.ply"].map(|name| (name, File::splats(1, 0).little()));
        let Imported { scene, lost } = read(frames(&far).into_iter(), &options).expect("three frames");
        assert_eq!(scene.filter.as_ref().map(|filter| filter.segments), Some(3), "numbers that count no frames");
        assert!(lost[0].contains("range of 99000"), "it is said: {lost:?}");
    }

    #[test]
    fn all_frames_are_in_the_space_of_the_first() {
        let at = |origin: &str| {
            let file =
                File { comments: vec![format!("gs4d.origin {origin}"), "gs4d.up +z".to_owned()], ..File::splats(1, 0) };
            file.little()
        };
        let files = [("f1.ply", at("1000 0 0")), ("f2.ply", at("2000 0 0"))];
        let scene = read(frames(&files).into_iter(), &ReadOptions::default()).expect("two frames").scene;
        assert_eq!(scene.playback.up, UpAxis::PosZ, "the axis of the first");
        assert_eq!(scene.trained_with.origin.place, [1000.0, 0.0, 0.0], "the origin of the first");
        let SceneForm::Ready(Form::Sliced(sliced)) = &scene.form else { panic!("the sliced form") };
        assert_eq!(sliced.gaussians[0].mean, sliced.gaussians[1].mean, "the same place in both frames");
    }

    #[test]
    fn frames_are_drawn_with_the_filter_of_mip_splatting_if_all_were_trained_with_it() {
        let plain = File::splats(1, 0).little();
        let filtered = File::splats(1, 0).comment("antialiased 1").little();
        let imported = |second: &[u8]| {
            let files = [("f1.ply", filtered.clone()), ("f2.ply", second.to_owned())];
            let options = ReadOptions { fps: Some(30.0), ..ReadOptions::default() };
            read(frames(&files).into_iter(), &options).expect("two frames")
        };
        let all = imported(&filtered);
        assert!(all.scene.trained_with.mip_filter && all.lost.is_empty(), "both frames: {:?}", all.lost);
        let some = imported(&plain);
        assert!(!some.scene.trained_with.mip_filter, "one of two frames");
        assert!(some.lost[0].starts_with("1 of 2 frames"), "it is stated: {:?}", some.lost);
    }

    #[test]
    fn a_frame_that_cannot_be_read_is_named() {
        let good = File::splats(1, 0).little();
        let message = refusal(&[("frame_1.ply", good.clone()), ("frame_2.ply", good[..90].to_owned())]);
        assert!(message.contains("frame_2.ply") && message.contains("cut"), "the frame and the fault: {message}");
        let moving = File::splats(1, 0).with("time", |_| 0.0).with("log_duration", |_| 0.0).little();
        let message = refusal(&[("frame_1.ply", moving)]);
        assert!(message.contains("frame_1.ply") && message.contains("moving"), "a frame with motion: {message}");
        assert!(refusal(&[]).contains("0 frames"), "no frames");
        let fails = || Frame { name: "gone.ply".to_owned(), bytes: Box::new(|| Err(io::Error::other("it is gone"))) };
        let message = read([fails()].into_iter(), &ReadOptions::default()).expect_err("it is gone").to_string();
        assert!(message.contains("gone.ply: it is gone"), "a file that cannot be opened: {message}");
        let lossy = File::splats(1, 72).little();
        let three = ["a1.ply", "a2.ply", "a3.ply"].map(|name| (name, lossy.clone()));
        let lost = read(frames(&three).into_iter(), &ReadOptions::default()).expect("three frames").lost;
        assert_eq!(lost.len(), 2, "one sentence for all frames, and one for their speed: {lost:?}");
        assert!(lost[0].starts_with("a1.ply and 2 other frames: "), "that says how many: {lost:?}");
        assert!(lost[1].contains("3 frames are played at 30 a second"), "the speed that is assumed: {lost:?}");
        let lost =
            read(frames(&[("\u{1b}[2J1.ply", lossy)]).into_iter(), &ReadOptions::default()).expect("a frame").lost;
        assert!(lost[0].starts_with("\\u{1b}[2J1.ply: "), "a name does not control the terminal: {lost:?}");
    }

    #[test]
    fn frames_are_ordered_by_their_numbers() {
        let names = |names: &[&str]| ordered(names.iter().map(|&name| name.to_owned()).collect());
        let found = names(&["f10.ply", "f9.compressed.ply", "notes.txt", "f007.ply", "model.ply"]);
        assert_eq!(found.expect("a sequence"), ["f007.ply", "f9.compressed.ply", "f10.ply"], "by number, not by name");
        let found = names(&["._f1.ply", "f1.ply", ".f2.ply", "f2.ply", ".DS_Store", "Thumbs.db"]);
        assert_eq!(found.expect("a sequence"), ["f1.ply", "f2.ply"], "hidden files are no frames");
        let found = names(&["F2.PLY", "F1.PLY"]);
        assert_eq!(found.expect("a sequence"), ["F1.PLY", "F2.PLY"], "extensions of either case, as of single files");
        assert!(!is_sequence(&["._f1.ply", "f1.ply"].map(str::to_owned)), "nor do they make a sequence");
        for (files, reason) in [
            (&["f1.ply"][..], "without a sequence"),
            (&["a.ply", "b.ply"], "without a sequence"),
            (&["f1.ply", "g2.ply"], "two sequences"),
            (&["f1.ply", "f01.ply", "f2.ply"], "two files of frame 1"),
        ] {
            let message = names(files).expect_err("no sequence").to_string();
            assert!(message.contains(reason), "{files:?}: {message}");
        }
        let many = names(&["f99999999999999999999.ply", "f1.ply", "f2.ply"]).expect("a sequence");
        assert_eq!(many, ["f1.ply", "f2.ply"], "a number that is too large is none");
    }
}
