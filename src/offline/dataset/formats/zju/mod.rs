//! `ZJU-MoCap` and what is made like it: `annots.npy`.
//!
//! In: a folder with `annots.npy` and the images that it names. Out: the views of all cameras at all moments, 30 a
//! second.
//!
//! The file is a dictionary: `cams` has lists of the camera matrices `K`, the coefficients of distortion `D`, the
//! rotations `R` and the translations `T` from the world to each camera, in millimeters; `ims` has, for each moment, a
//! dictionary whose `ims` are the names of the images, one for each camera. The conventions are OpenCV's: principal
//! points are counted from the middle of the first pixel. The file is a pickle, of which only data is read (`pickle`).

mod pickle;

use super::files::{OnDisk, with_slashes};
use super::undivided::Undivided;
use super::{limited, masks, moments, picture_size};
use crate::codec::npy::Array;
use crate::codec::text::{is_obeyed, printable};
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::lens::OriginalLens;
use crate::offline::dataset::cameras::opencv;
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::{CameraOptions, Clock, DatasetError, FrameProblem};
use glam::{DMat4, UVec2};
use pickle::{Id, Pickle};
use std::collections::HashSet;
use std::path::{Component, Path};

/// Name of the file.
const ANNOTATIONS: &str = "annots.npy";
/// Most bytes of the file. With the joints of people in every image, the largest known one has some 50 million.
const MAX_BYTES: u64 = 1 << 27;
/// Most images.
const MAX_IMAGES: usize = 1 << 20;
/// Folders with the parts of bodies, by number.
const PARTS: [&str; 3] = ["mask_cihp", "mask", "mask-schp"];
/// Cameras that are all closer to 0 than this, in units of the file, have places in meters.
const METERS: f64 = 100.0;
/// Millimeters in a meter.
const MILLIMETERS: f64 = 1000.0;
/// The largest number of coefficients of distortion.
const MOST_COEFFICIENTS: usize = 14;

/// The sentence about the rate of frames.
const RATE: &str = "its frames are taken as 30 a second: --duration sets the seconds of the capture";

/// A camera.
struct Camera {
    world_to_camera: DMat4,
    lens: OriginalLens,
    distortion: Distortion,
}

/// Numbers of all cameras, as the file has them: so many for each.
struct Numbers {
    all: Vec<f64>,
    each: usize,
}

/// Returns whether a folder has the file.
pub(crate) fn is_there(folder: &Path) -> bool {
    folder.join(ANNOTATIONS).is_file()
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let source = folder.join(ANNOTATIONS);
    let unusable = |reason: String| DatasetError::Unusable { path: source.clone(), reason };
    let bytes = limited::bytes(&source, MAX_BYTES, "dictionary of cameras")?;
    let pickle = Pickle::parse(object(&bytes).map_err(unusable)?).map_err(unusable)?;
    let moments = names(&pickle).map_err(unusable)?;
    let (cameras, in_meters) = cameras(&pickle, moments[0].len()).map_err(unusable)?;
    let on_disk = OnDisk::default();
    let sizes = sizes(folder, &moments[0], &on_disk, options)?.ok_or_else(|| {
        unusable("it has no size of the pictures, and none of the first images is on disk: put them there".to_owned())
    })?;
    let (times, counted) = moments::times(&[&moments]);
    let (mut taken, mut unplaced, unusable) = (HashSet::new(), Vec::new(), &unusable);
    for (images, time) in moments.iter().zip(times.into_iter().flatten()) {
        for ((name, camera), size) in images.iter().zip(&cameras).zip(&sizes) {
            let failed = move |problem: FrameProblem| unusable(format!("image {}: {problem}", printable(name)));
            let frame = frame(folder, name, camera, time, &on_disk, &mut taken).map_err(failed)?;
            unplaced.push(Unplaced { frame, original: *size, failed });
        }
    }
    let Placed { views, origin, notes: undone } = place(unplaced, options, true)?;
    let known = [unit(in_meters), counted, Some(RATE.to_owned()), parts(folder), on_disk.note()];
    let notes = known.into_iter().flatten().chain(undone).collect();
    Ok(Undivided { source, views, splits: None, clock: Clock::NUMBERED, points: None, notes, origin })
}

/// Returns a sentence about the unit of places.
fn unit(in_meters: bool) -> Option<String> {
    Some(if in_meters {
        format!("all its translations are shorter than {METERS}: they are taken as meters, not as millimeters")
    } else {
        "its translations are millimeters: places of cameras are in meters".to_owned()
    })
}

/// Returns a sentence about the folders of the parts of bodies.
fn parts(folder: &Path) -> Option<String> {
    let found = PARTS.into_iter().find(|name| folder.join(name).is_dir())?;
    Some(format!(
        "{found}/ has the numbers of parts of the body, and is no coverage: to train on people alone, put pictures \
         into masks/ that are white where it is not 0"
    ))
}

/// Returns the pickle of an array of one object.
fn object(bytes: &[u8]) -> Result<&[u8], String> {
    match Array::read(bytes) {
        Some(Array { kind: "|O" | "O", values, .. }) => Ok(values),
        Some(Array { kind, .. }) => Err(format!(
            "its values are of the type {}, and annots.npy of ZJU-MoCap has a dictionary of cams and ims",
            printable(kind)
        )),
        None => Err("not a whole .npy file: copy it again".to_owned()),
    }
}

/// Returns the names of the images of each moment, one for each camera: at least one moment, and one camera.
fn names<'a>(pickle: &Pickle<'a>) -> Result<Vec<Vec<&'a str>>, String> {
    let list = pickle.entry(pickle.root(), "ims").and_then(|list| pickle.items(list));
    let list = list.ok_or("it has no list ims of the images of each moment: save it with one")?;
    let (mut moments, mut total) = (Vec::new(), 0);
    for (moment, &id) in list.iter().enumerate() {
        let names = pickle.entry(id, "ims").and_then(|names| pickle.items(names));
        let names =
            names.ok_or_else(|| format!("moment {moment} of ims has no list ims of names: save it with one"))?;
        total += names.len();
        if total > MAX_IMAGES {
            return Err(format!("it has more than {MAX_IMAGES} images: save a part of the moments"));
        }
        let texts: Option<Vec<&str>> = names.iter().map(|&name| pickle.text(name)).collect();
        moments.push(texts.ok_or_else(|| format!("a name of moment {moment} of ims is no text: save it as one"))?);
    }
    let count = moments.first().map_or(0, Vec::len);
    match moments.iter().position(|names| names.len() != count) {
        _ if count == 0 => Err("its list ims has no images: save it with their names".to_owned()),
        Some(moment) => Err(format!(
            "moment {moment} of ims has {} images, and moment 0 has {count}: save it with one for each camera",
            moments[moment].len()
        )),
        None => Ok(moments),
    }
}

/// Returns the cameras, of which there are so many, and whether their places are in meters in the file.
fn cameras(pickle: &Pickle<'_>, count: usize) -> Result<(Vec<Camera>, bool), String> {
    let cams = pickle.entry(pickle.root(), "cams").ok_or("it has no dictionary cams: save it with one")?;
    let entry =
        |name: &str| pickle.entry(cams, name).ok_or_else(|| format!("its cams has no {name}: save it with one"));
    let of = |name: &str, each: usize| Numbers::exactly(pickle, name, entry(name)?, [count, each]);
    let (matrices, rotations, translations) = (of("K", 9)?, of("R", 9)?, of("T", 3)?);
    let distortions = pickle.entry(cams, "D").map(|id| Numbers::even(pickle, "D", id, count)).transpose()?;
    let in_meters = translations.all.iter().all(|value| value.abs() < METERS);
    let unit = if in_meters { 1.0 } else { MILLIMETERS };
    let camera = |index: usize| -> Result<Camera, String> {
        let failed = |problem: FrameProblem| format!("camera {index}: {problem}");
        let translation = translations.of::<3>(index).map(|value| value / unit);
        let coefficients = distortions.as_ref().map_or(&[][..], |numbers| numbers.at(index));
        Ok(Camera {
            world_to_camera: opencv::pose_of_rows(&rotations.of::<9>(index), translation).map_err(failed)?,
            lens: opencv::own_lens(&matrices.of(index)).map_err(failed)?,
            distortion: opencv::distortion(coefficients).map_err(failed)?,
        })
    };
    let cameras: Vec<Camera> = (0..count).map(camera).collect::<Result<_, _>>()?;
    Ok((cameras, in_meters))
}

impl Numbers {
    /// Reads an entry that must have so many numbers for each of so many cameras.
    fn exactly(pickle: &Pickle<'_>, name: &str, id: Id, [count, each]: [usize; 2]) -> Result<Self, String> {
        let remedy = format!("{each} for each of the {count} images of a moment: save it with them");
        let all = pickle.numbers(id, count * each);
        let all = all.map_err(|found| format!("its cams has {found} in {name}, not {remedy}"))?;
        if all.len() != count * each {
            return Err(format!("its cams has {} numbers in {name}, not {remedy}", all.len()));
        }
        Ok(Self { all, each })
    }

    /// Reads an entry that must have as many numbers for each of so many cameras.
    fn even(pickle: &Pickle<'_>, name: &str, id: Id, count: usize) -> Result<Self, String> {
        let remedy = format!("as many for each of the {count} images of a moment: save it with them");
        let all = pickle.numbers(id, count * MOST_COEFFICIENTS);
        let all = all.map_err(|found| format!("its cams has {found} in {name}, not {remedy}"))?;
        if !all.len().is_multiple_of(count) {
            return Err(format!("its cams has {} numbers in {name}, not {remedy}", all.len()));
        }
        Ok(Self { each: all.len() / count, all })
    }

    /// Returns the numbers of a camera.
    fn at(&self, camera: usize) -> &[f64] {
        self.all.get(camera * self.each..(camera + 1) * self.each).unwrap_or_default()
    }

    /// Returns the numbers of a camera, which has `N`.
    fn of<const N: usize>(&self, camera: usize) -> [f64; N] {
        self.at(camera).try_into().unwrap_or([f64::NAN; N])
    }
}

/// Returns the size of the pictures of each camera: that of its first image, else that of another camera's, or of the
/// options. `None` if there is none.
fn sizes(
    folder: &Path,
    first: &[&str],
    on_disk: &OnDisk,
    options: &CameraOptions,
) -> Result<Option<Vec<UVec2>>, DatasetError> {
    let mut found = Vec::new();
    for name in first {
        let image = is_inside(name).then(|| on_disk.find(folder, &*with_slashes(name)));
        found.push(image.map(|image| picture_size::of_image(&image, options)).transpose()?.flatten());
    }
    let usual = found.iter().flatten().next().copied().or(options.size);
    Ok(usual.map(|usual| found.into_iter().map(|size| size.unwrap_or(usual)).collect()))
}

/// Returns whether a name is that of a file inside the folder.
fn is_inside(name: &str) -> bool {
    let is_plain = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    !name.contains(is_obeyed) && Path::new(&*with_slashes(name)).components().all(is_plain)
}

/// Returns the frame of a camera.
fn frame(
    folder: &Path,
    name: &str,
    camera: &Camera,
    time: f64,
    on_disk: &OnDisk,
    taken: &mut HashSet<String>,
) -> Result<Frame, FrameProblem> {
    let unnamed = || FrameProblem::FileName(name.to_owned());
    if !is_inside(name) {
        return Err(unnamed());
    }
    let file = with_slashes(name);
    let label = file.strip_prefix("./").unwrap_or(&file).replace('/', "_");
    Ok(Frame {
        name: output_name(&label, taken.len(), taken).ok_or_else(unnamed)?,
        image: on_disk.find(folder, &*file),
        mask: masks::beside(folder, Path::new(&*file)).map(|path| Mask { path, applied: false }),
        time,
        world_to_camera: camera.world_to_camera,
        lens: camera.lens,
        distortion: camera.distortion,
    })
}
