//! Footage of cameras that stand still: a video, or a folder of frames, for each camera of a calibration.
//!
//! In: a folder, and the cameras of a calibration. Out: the views of all cameras at all frames, with sentences about
//! cameras without footage, footage without a camera, and what is assumed.
//!
//! Footage lies in the folder, or in `frames/`, `images/` or `videos/` in it: videos, and folders with the images of a
//! camera, or with `images/` in which they are. A folder takes the place of a video of its name. Footage has the name
//! of its camera: in any letter case, without the extension of a video; or with the same letters and numbers, so that
//! `cam_01` is `Cam1`. Frames have the rate of the video of their name, else 30 a second.

use super::files::points_beside;
use super::numbered::{FRAME_RATE, entries, has_video_extension, images, is_video, number, times_at};
use super::standing::{self, Shot, Standing};
use super::undivided::Undivided;
use super::video::{self, Videos};
use super::video_rate;
use super::{limited, picture_size};
use crate::codec::text::printable;
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::lens::{OriginalLens, checked_size};
use crate::offline::dataset::cameras::placing::Placed;
use crate::offline::dataset::view::has_aspect_of;
use crate::offline::dataset::{CameraOptions, Clock, DatasetError};
use glam::{DMat4, UVec2};
use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::iter::repeat_n;
use std::path::{Path, PathBuf};

/// Folders in which footage lies: that of the dataset, and these in it.
const PLACES: [&str; 4] = ["", "frames", "images", video::VIDEOS];
/// A folder of images that is no camera.
const MASKS: &str = "masks";
/// A part of the names of folders of calibrations, whose images are no footage.
const CALIBRATION: &str = "calib";
/// Pictures that are smaller than the calibration's by at most this part of a side are cut: encoders need sides that
/// are multiples of 8 or 16.
const CUT: u32 = 50;
/// Most bytes of a calibration. A camera takes about 1,500.
const MAX_BYTES: u64 = 1 << 24;
/// Most names that a sentence lists.
const LISTED: usize = 4;

/// The cameras of a calibration.
pub(crate) struct Calibration {
    /// The file.
    pub source: PathBuf,
    pub cameras: Vec<RigCamera>,
    /// Assumptions and omissions, a sentence each.
    pub notes: Vec<String>,
}

impl Calibration {
    /// Reads the file of a calibration.
    ///
    /// # Errors
    /// A file that cannot be read, or is far too long.
    pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, DatasetError> {
        limited::bytes(path, MAX_BYTES, "calibration of cameras")
    }
}

/// A camera that stands still.
pub(crate) struct RigCamera {
    /// Its name in the calibration.
    pub name: String,
    /// Size of the pictures that it is calibrated for, pixels; `None` if that is the size of its pictures.
    pub size: Option<UVec2>,
    pub world_to_camera: DMat4,
    pub lens: OriginalLens,
    pub distortion: Distortion,
}

/// The clocks of cameras. Default: they are the same, and frames have the rate of a video or 30 a second.
#[derive(Default)]
pub(crate) struct Clocks {
    /// Frames a second where no video tells them.
    pub rate: Option<f64>,
    /// By the names of cameras, the seconds by which the times of their frames are too large.
    pub late: HashMap<String, f64>,
}

/// A video, or a folder of frames.
#[derive(Debug, Clone, PartialEq)]
struct Footage {
    /// The stem of the video, or the name of the folder.
    name: String,
    /// The video, or the folder that has the images.
    path: PathBuf,
    /// Frames a second of the video, if they are known.
    rate: Option<f64>,
}

/// A camera with its frames.
struct Filmed<'a> {
    camera: &'a RigCamera,
    /// The place of the camera in the calibration, from 0.
    index: usize,
    footage: &'a Footage,
    /// The images; a video that is not decoded is the only frame.
    frames: Vec<PathBuf>,
    /// Size of the pictures that the lens is for, pixels.
    size: UVec2,
}

/// Reads the views of the cameras of a calibration.
///
/// # Errors
/// No camera with footage; several cameras or several videos of one name; pictures of another shape than the
/// calibration's; a camera that cannot be used.
pub(crate) fn read(
    folder: &Path,
    calibration: Calibration,
    options: &CameraOptions,
    videos: Videos<'_>,
) -> Result<Undivided, DatasetError> {
    read_by(folder, calibration, &Clocks::default(), options, videos)
}

/// Reads as [`read`], and returns the place in the calibration of the camera of each view, too.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_with_cameras(
    folder: &Path,
    calibration: Calibration,
    options: &CameraOptions,
    videos: Videos<'_>,
) -> Result<(Undivided, Vec<usize>), DatasetError> {
    read_all(folder, calibration, &Clocks::default(), options, videos)
}

/// Reads as [`read`], with clocks of the cameras that are not the same.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_by(
    folder: &Path,
    calibration: Calibration,
    clocks: &Clocks,
    options: &CameraOptions,
    videos: Videos<'_>,
) -> Result<Undivided, DatasetError> {
    Ok(read_all(folder, calibration, clocks, options, videos)?.0)
}

/// Reads the views, and the place in the calibration of the camera of each.
fn read_all(
    folder: &Path,
    calibration: Calibration,
    clocks: &Clocks,
    options: &CameraOptions,
    mut videos: Videos<'_>,
) -> Result<(Undivided, Vec<usize>), DatasetError> {
    let Calibration { source, cameras, mut notes } = calibration;
    let mut footage = footage(folder)?;
    footage.iter_mut().for_each(|one| one.rate = one.rate.or(clocks.rate));
    let partners = partners(&cameras, &footage).map_err(|reason| unusable(&source, reason))?;
    let mut filmed = Vec::new();
    for (index, (camera, partner)) in cameras.iter().zip(&partners).enumerate() {
        if let Some(at) = partner {
            let found = (camera, &footage[*at]);
            filmed.push(Filmed::of(folder, &source, index, found, options, &mut videos)?);
        }
    }
    notes.extend(unpaired(&cameras, &footage, &partners));
    notes.extend(assumed(&filmed));
    let names = |index: usize| cameras.get(index).map_or(String::new(), |camera| printable(&camera.name));
    let named = |error: DatasetError| match error {
        DatasetError::Frame { path, frame, problem } => unusable(&path, format!("camera {}: {problem}", names(frame))),
        other => other,
    };
    let standing = at_times(filmed, &clocks.late);
    let of_views = standing.iter().flat_map(|camera| repeat_n(camera.index, camera.shots.len())).collect();
    let Placed { views, origin, notes: undone } = standing::views(folder, &source, standing, options).map_err(named)?;
    notes.extend(undone);
    let points = points_beside(folder);
    Ok((Undivided { source, views, splits: None, clock: Clock::NUMBERED, points, notes, origin }, of_views))
}

/// Returns the cameras with the times of their frames. The first number of all cameras is time 0, of that camera whose
/// times are the latest.
fn at_times(filmed: Vec<Filmed<'_>>, late: &HashMap<String, f64>) -> Vec<Standing> {
    let decoded = filmed.iter().flat_map(|filmed| &filmed.frames).filter(|frame| !is_video(frame));
    let first = decoded.filter_map(|frame| number(frame)).min().unwrap_or(0);
    let seconds = |camera: &RigCamera| late.get(&camera.name).copied().unwrap_or(0.0);
    let latest = filmed.iter().map(|filmed| seconds(filmed.camera)).reduce(f64::max).unwrap_or(0.0);
    let standing = |filmed: Filmed<'_>| {
        let (times, later) = (filmed.times(first), latest - seconds(filmed.camera));
        let Filmed { camera, index, footage, frames, size } = filmed;
        let &RigCamera { world_to_camera, lens, distortion, .. } = camera;
        let shots = frames.into_iter().zip(times).map(|(image, time)| Shot { image, time: time + later }).collect();
        Standing { name: footage.name.clone(), index, shots, size, world_to_camera, lens, distortion }
    };
    filmed.into_iter().map(standing).collect()
}

impl<'a> Filmed<'a> {
    /// Finds the frames of a camera.
    fn of(
        folder: &Path,
        source: &Path,
        index: usize,
        (camera, footage): (&'a RigCamera, &'a Footage),
        options: &CameraOptions,
        videos: &mut Videos<'_>,
    ) -> Result<Self, DatasetError> {
        let frames = footage.frames(folder, videos)?;
        let first = frames.first().filter(|frame| !is_video(frame));
        let found = first.map(|image| picture_size::of_image(image, options)).transpose()?.flatten();
        let size = calibrated_size(camera, found).map_err(|reason| unusable(source, reason))?.or(options.size);
        // The size of the pictures of a video that is not decoded is of no importance.
        let size = size.or_else(|| centered_size(camera.lens).filter(|_| first.is_none()));
        let size = size.ok_or_else(|| DatasetError::SizeUnknown { path: source.to_owned() })?;
        Ok(Self { camera, index, footage, frames, size })
    }

    /// Returns whether the frames are images.
    fn is_decoded(&self) -> bool {
        !self.frames.iter().any(|frame| is_video(frame))
    }

    /// Returns the frames a second.
    fn rate(&self) -> f64 {
        self.footage.rate.unwrap_or(FRAME_RATE)
    }

    /// Returns the times of the frames, seconds. The number `first` is time 0.
    fn times(&self, first: u64) -> Vec<f64> {
        if self.is_decoded() { times_at(&self.frames, first, self.rate()) } else { vec![0.0; self.frames.len()] }
    }
}

impl Footage {
    /// Returns the images; a video that is not decoded is the only frame.
    fn frames(&self, folder: &Path, videos: &mut Videos<'_>) -> Result<Vec<PathBuf>, DatasetError> {
        if !is_video(&self.path) {
            return images(&self.path);
        }
        match videos {
            Videos::Decode(progress) => video::frames(folder, &self.path, &self.name, &mut **progress),
            Videos::Leave => Ok(video::decoded(folder, &self.name)?.unwrap_or_else(|| vec![self.path.clone()])),
        }
    }

    /// Returns the name on disk.
    fn shown(&self) -> String {
        let video = self.path.file_name().filter(|_| has_video_extension(&self.path));
        video.map_or_else(|| format!("{}/", self.name), |name| name.to_string_lossy().into_owned())
    }
}

/// Returns the names and paths of the videos, and of the folders of frames, in a folder.
///
/// # Errors
/// Two folders or two videos of one name, a folder that cannot be listed.
pub(crate) fn found(folder: &Path) -> Result<Vec<(String, PathBuf)>, DatasetError> {
    Ok(footage(folder)?.into_iter().map(|one| (one.name, one.path)).collect())
}

/// Returns the folders of frames, and the videos of other names.
///
/// # Errors
/// Two folders or two videos of one name.
fn footage(folder: &Path) -> Result<Vec<Footage>, DatasetError> {
    let (mut folders, mut videos) = (Vec::new(), Vec::new());
    for path in PLACES.iter().map(|place| entries(&folder.join(place))).collect::<Result<Vec<_>, _>>()?.concat() {
        let is_video = is_video(&path);
        let name = if is_video { path.file_stem() } else { path.file_name() };
        let Some(name) = name.and_then(OsStr::to_str).map(str::to_owned) else { continue };
        if is_video {
            let rate = video_rate::of(&path);
            videos.push(Footage { name, path, rate });
        } else if let Some(path) = with_images(&name, &path)? {
            folders.push(Footage { name, path, rate: None });
        }
    }
    let mut named = by_names(folders)?;
    for (key, video) in by_names(videos)? {
        let rate = video.rate;
        named.entry(key).or_insert(video).rate = rate;
    }
    let mut all: Vec<Footage> = named.into_values().collect();
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

/// Returns the folder with the images of a camera: this folder, or `images/` in it.
fn with_images(name: &str, path: &Path) -> Result<Option<PathBuf>, DatasetError> {
    let lower = name.to_lowercase();
    if PLACES.contains(&&*lower) || lower == MASKS || lower.contains(CALIBRATION) || !path.is_dir() {
        return Ok(None);
    }
    for place in [path.to_owned(), path.join("images")] {
        if !images(&place)?.is_empty() {
            return Ok(Some(place));
        }
    }
    Ok(None)
}

/// Returns footage by its names, which differ not in letter case alone.
fn by_names(footage: Vec<Footage>) -> Result<HashMap<String, Footage>, DatasetError> {
    let mut named: HashMap<String, Footage> = HashMap::new();
    for one in footage {
        let path = one.path.clone();
        if let Some(other) = named.insert(by_name(&one.name), one) {
            let other = other.path.display();
            return Err(unusable(&path, format!("it has the name of {other}: remove one of them, or rename it")));
        }
    }
    Ok(named)
}

/// Returns the place of the footage of each camera.
///
/// # Errors
/// Two cameras of one name, no camera with footage.
fn partners(cameras: &[RigCamera], footage: &[Footage]) -> Result<Vec<Option<usize>>, String> {
    let mut names = HashSet::new();
    if let Some(camera) = cameras.iter().find(|camera| !names.insert(by_name(&camera.name))) {
        return Err(format!("two of its cameras are named {}: rename one", printable(&camera.name)));
    }
    let mut partners = vec![None; cameras.len()];
    for key in [by_name, by_characters] {
        pair(key, cameras, footage, &mut partners);
    }
    if partners.iter().any(Option::is_some) {
        return Ok(partners);
    }
    let there = if footage.is_empty() { "none".to_owned() } else { listed(footage.iter().map(Footage::shown)) };
    Err(format!(
        "none of its cameras ({}) has a video or a folder of frames beside it: name these like the cameras; there is \
         {there}",
        listed(cameras.iter().map(|camera| camera.name.clone()))
    ))
}

/// Returns sentences about names that differ, cameras without footage, and footage without a camera.
fn unpaired(cameras: &[RigCamera], footage: &[Footage], partners: &[Option<usize>]) -> Vec<String> {
    let (mut loose, mut alone) = (Vec::new(), Vec::new());
    for (camera, partner) in cameras.iter().zip(partners) {
        match partner.map(|at| &footage[at]) {
            Some(found) if by_name(&found.name) != by_name(&camera.name) => {
                loose.push(format!("{} is {}", camera.name, found.shown()));
            }
            Some(_) => {}
            None => alone.push(camera.name.clone()),
        }
    }
    let unused = footage.iter().enumerate().filter(|(at, _)| !partners.contains(&Some(*at)));
    let unused: Vec<String> = unused.map(|(_, footage)| footage.shown()).collect();
    let sentences = [
        ("names count as the same if their letters and numbers are", loose),
        ("cameras of the calibration without a video and without frames are left out", alone),
        ("videos and folders of frames without a camera in the calibration are left out", unused),
    ];
    let said = sentences.into_iter().filter(|(_, names)| !names.is_empty());
    said.map(|(start, names)| format!("{start}: {}", listed(names.into_iter()))).collect()
}

/// Pairs cameras and footage that have no partner yet, where one of each has a key.
fn pair(key: fn(&str) -> String, cameras: &[RigCamera], footage: &[Footage], partners: &mut [Option<usize>]) {
    let taken: HashSet<usize> = partners.iter().flatten().copied().collect();
    let mut found: HashMap<String, (Vec<usize>, Vec<usize>)> = HashMap::new();
    for (index, camera) in cameras.iter().enumerate().filter(|(index, _)| partners[*index].is_none()) {
        found.entry(key(&camera.name)).or_default().0.push(index);
    }
    for (index, footage) in footage.iter().enumerate().filter(|(index, _)| !taken.contains(index)) {
        found.entry(key(&footage.name)).or_default().1.push(index);
    }
    for (cameras, footage) in found.into_values() {
        if let ([camera], [footage]) = (&cameras[..], &footage[..]) {
            partners[*camera] = Some(*footage);
        }
    }
}

/// Returns a name in small letters, without the extension of a video.
fn by_name(name: &str) -> String {
    let path = Path::new(name);
    let stem = path.file_stem().and_then(OsStr::to_str).filter(|_| has_video_extension(path));
    stem.unwrap_or(name).to_lowercase()
}

/// Returns the letters and numbers of a name, a `#` before each number and no zeros.
fn by_characters(name: &str) -> String {
    let (mut key, mut in_number) = (String::new(), false);
    for c in by_name(name).chars() {
        if c.is_ascii_digit() && !in_number {
            key.push('#');
        } else if c.is_ascii_digit() && key.ends_with("#0") {
            key.pop();
        }
        in_number = c.is_ascii_digit();
        key.extend(c.is_alphanumeric().then_some(c));
    }
    key
}

/// Returns the size of the pictures that the lens of a camera is for; `None` if it is not known. Pictures that are cut
/// at the right and the bottom have pixels of the same coordinates. `found` is the size of the pictures on disk.
///
/// # Errors
/// Pictures of another shape.
fn calibrated_size(camera: &RigCamera, found: Option<UVec2>) -> Result<Option<UVec2>, String> {
    let (Some(size), Some(found)) = (camera.size, found) else { return Ok(camera.size.or(found)) };
    // A calibration may count the last pixel as the size.
    if found.x.abs_diff(size.x).max(found.y.abs_diff(size.y)) <= 1 {
        return Ok(Some(found));
    }
    if has_aspect_of(found, size) {
        return Ok(Some(size));
    }
    // The pictures may be scaled, too.
    let scale = (found.as_dvec2() / size.as_dvec2()).max_element();
    let cut = (found.as_dvec2() / scale).round().as_uvec2().max(UVec2::ONE);
    if (size.saturating_sub(cut) * CUT).cmple(size).all() {
        return Ok(Some(cut));
    }
    let remedy = if has_aspect_of(UVec2::new(found.y, found.x), size) {
        "turn them by 90 degrees"
    } else {
        "cut or scale them to that shape, or correct the size in the calibration"
    };
    Err(format!(
        "camera {} is calibrated for {} x {} pixels, and its pictures have {} x {}: {remedy}",
        printable(&camera.name),
        size.x,
        size.y,
        found.x,
        found.y
    ))
}

/// Returns the size of pictures whose center is the principal point.
fn centered_size(lens: OriginalLens) -> Option<UVec2> {
    let OriginalLens::Intrinsics { center, .. } = lens else { return None };
    let size = (2.0 * center).round();
    checked_size(size.x, size.y).ok()
}

/// Returns sentences about what is assumed of the frames.
fn assumed(filmed: &[Filmed<'_>]) -> Vec<String> {
    let name = |filmed: &Filmed<'_>| filmed.footage.name.clone();
    let cut = filmed.iter().filter(|filmed| filmed.camera.size.is_some_and(|size| size != filmed.size));
    let cut: Vec<String> =
        cut.map(|filmed| format!("{} at {} x {}", name(filmed), filmed.size.x, filmed.size.y)).collect();
    let decoded: Vec<&Filmed<'_>> = filmed.iter().filter(|filmed| filmed.is_decoded()).collect();
    let unknown = decoded.iter().filter(|filmed| filmed.footage.rate.is_none());
    let unknown: Vec<String> = unknown.map(|filmed| name(filmed)).collect();
    let differing = |value: fn(&Filmed<'_>) -> f64| {
        let is_same = decoded.windows(2).all(|pair| value(pair[0]) == value(pair[1]));
        let shown = decoded.iter().filter(|_| !is_same).map(|filmed| format!("{} {}", name(filmed), value(filmed)));
        shown.collect::<Vec<String>>()
    };
    let sentences = [
        ("pictures that are smaller than in the calibration count as cut at the right and the bottom", cut),
        ("frames of unknown rate count at 30 a second", unknown),
        ("cameras have different rates, frames a second", differing(|filmed| filmed.rate())),
        ("cameras have different numbers of frames", differing(|filmed| filmed.frames.len() as f64)),
    ];
    let said = sentences.into_iter().filter(|(_, names)| !names.is_empty());
    let mut notes: Vec<String> = said.map(|(start, names)| format!("{start}: {}", listed(names.into_iter()))).collect();
    if decoded.len() > 1 && decoded.iter().any(|filmed| filmed.frames.len() > 1) {
        notes.push("frames of one time are taken as one moment: cameras must be synchronized".to_owned());
    }
    notes
}

/// Returns the first few names.
pub(crate) fn listed(names: impl Iterator<Item = String>) -> String {
    let names: Vec<String> = names.map(|name| printable(&name)).collect();
    let first = names[..names.len().min(LISTED)].join(", ");
    match names.len().saturating_sub(LISTED) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

fn unusable(path: &Path, reason: String) -> DatasetError {
    DatasetError::Unusable { path: path.to_owned(), reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(name: &str, size: Option<[u32; 2]>) -> RigCamera {
        RigCamera {
            name: name.to_owned(),
            size: size.map(UVec2::from),
            world_to_camera: DMat4::IDENTITY,
            lens: OriginalLens::Angle(1.0),
            distortion: Distortion::default(),
        }
    }

    fn at(name: &str) -> Footage {
        Footage { name: name.to_owned(), path: PathBuf::from(name), rate: None }
    }

    #[test]
    fn footage_is_found_by_the_name_of_its_camera() {
        let cameras = ["cam_01", "CAM02.mp4", "c", "d"].map(|name| camera(name, None));
        let footage = ["Cam1", "cam02", "C", "other"].map(at);
        let found = partners(&cameras, &footage).expect("three cameras have footage");
        assert_eq!(found, [Some(0), Some(1), Some(2), None], "by characters, by name, by letter case");
        let notes = unpaired(&cameras, &footage, &found);
        assert_eq!(notes.len(), 3, "a sentence of each kind: {notes:?}");
        for (note, part) in notes.iter().zip(["cam_01 is Cam1/", "left out: d", "left out: other/"]) {
            assert!(note.ends_with(part), "{part:?} is not the end of: {note}");
        }
        let several = ["cam1", "cam_1", "c"].map(at);
        let found = partners(&cameras, &several).expect("one camera has footage");
        assert_eq!(found, [None, None, Some(2), None], "either of two may be meant, so that neither is");
    }

    #[test]
    fn cameras_without_any_footage_are_refused_with_their_names() {
        let cameras = ["a", "b"].map(|name| camera(name, None));
        let error = partners(&cameras, &[]).expect_err("nothing is there");
        assert!(
            error.contains("none of its cameras (a, b) has a video") && error.ends_with("there is none"),
            "{error}"
        );
        let error = partners(&cameras, &[at("x")]).expect_err("another name");
        assert!(error.ends_with("there is x/"), "{error}");
        let twice = ["a", "A"].map(|name| camera(name, None));
        let error = partners(&twice, &[]).expect_err("two cameras of one name");
        assert!(error.contains("two of its cameras are named A"), "{error}");
    }

    #[test]
    fn numbers_of_names_have_no_zeros_before_them() {
        for (a, b) in [("cam_01", "Cam1"), ("cam-1_02", "cam1.2"), ("View 007", "view7"), ("c00", "C0")] {
            assert_eq!(by_characters(a), by_characters(b), "{a} is {b}");
        }
        for (a, b) in [("cam1_02", "cam102"), ("cam10", "cam1"), ("a", "b")] {
            assert_ne!(by_characters(a), by_characters(b), "{a} is not {b}");
        }
    }

    #[test]
    fn pictures_may_be_scaled_or_cut_at_their_ends() {
        let calibrated = camera("a", Some([1088, 1920]));
        let size = |x: u32, y: u32| calibrated_size(&calibrated, Some(UVec2::new(x, y)));
        for (found, expected) in [
            ([1088, 1920], [1088, 1920]),
            ([544, 960], [1088, 1920]),
            ([1080, 1920], [1080, 1920]),
            ([540, 960], [1080, 1920]),
            ([1087, 1919], [1087, 1919]),
        ] {
            let size = size(found[0], found[1]).expect("the shape of the calibration");
            assert_eq!(size, Some(UVec2::from(expected)), "pictures of {found:?}");
        }
        let turned = size(1920, 1088).expect_err("turned pictures");
        assert!(
            turned.contains("camera a is calibrated for 1088 x 1920 pixels") && turned.contains("turn"),
            "{turned}"
        );
        assert!(size(1000, 1920).expect_err("another shape").contains("cut or scale"), "8 % are no cut");
        assert_eq!(calibrated_size(&calibrated, None), Ok(calibrated.size), "pictures that are not on disk");
        assert_eq!(calibrated_size(&camera("b", None), Some(UVec2::ONE)), Ok(Some(UVec2::ONE)), "no calibrated size");
    }
}
