//! From footage to a dataset, in stages.
//!
//! In: [`FootageSettings`]. Out: a folder with pictures, cameras, times, plates, masks, points and a verdict
//! ([`MadeDataset`]). [`footage`] is the list of stages. Their results are in the folder of the dataset and, as lists
//! and figures, in `DATASET.footage` beside it, so that an interrupted run resumes, and a later one does nothing. The
//! pictures that stages work with are there too, until the run is complete.
//!
//! | file | subject |
//! |---|---|
//! | `plain` | whether the cameras of a folder are known |
//! | `output` | the folder of the dataset, and files in it that appear whole |
//! | `poses` | poses: cameras that are found by COLMAP |
//! | `source`, `names` | the views of the footage, with names of cameras and frames |
//! | `clocks`, `timing` | sync: the times of one clock |
//! | `masking` | plates: what stands still, and masks of what moves |
//! | `cloud` | points: what moves and what stands, at every moment |
//! | `written` | dataset: pictures and the file of cameras |
//! | `rehearsal` | rehearsal, on request: a short training on the dataset |
//! | `judged` | verdict: what the footage can give |
//! | `made` | what has been made |

mod clocks;
mod cloud;
mod judged;
mod made;
mod masking;
mod names;
mod output;
mod plain;
mod poses;
mod rehearsal;
mod source;
mod timing;
mod written;

pub use made::MadeDataset;
pub(crate) use plain::{is_raw, uncalibrated};

use super::sync::SIDE;
use super::take::{Take, reduced};
use super::verdict::LONGEST;
use super::working::WorkingPictures;
use super::{FootageError, FootageSettings};
use crate::offline::dataset::{Dataset, Split, TrainingView};
use crate::offline::store::results::{BAKE_FOLDER, Key, Store, folder_beside};
use crate::offline::store::stages::Stages;
use crate::offline::store::stored::Text;
use crate::offline::work::Progress;
use crate::view::Camera;
use clocks::Clocks;
use cloud::Cloud;
use judged::Judged;
use masking::{Given, Masked, Names};
use poses::FoundCameras;
use rehearsal::Rehearsed;
use source::{Shot, Source};
use std::path::{Path, PathBuf};
use timing::timed;
use written::Written;

/// The ending of the folder of results, after the name of the dataset.
const FOLDER: &str = ".footage";
/// The folder of the pictures to work with, in that of results.
const PICTURES: &str = "pictures";
/// Number of stages: poses, sync, plates, points, dataset, rehearsal, verdict.
const STAGES: usize = 7;
/// The name of the dataset that is made before a bake or a training, in its folder of results.
const DATASET: &str = "dataset";

/// Makes a dataset of footage: runs every stage whose result is not there. Begins the task "footage" and, inside it,
/// the tasks of the stages.
///
/// # Errors
/// A folder without footage; cameras, pictures or videos that cannot be used; a folder of the dataset that has other
/// files or cannot be written to; another run to the same dataset; an interruption.
pub fn footage(settings: &FootageSettings, progress: &mut dyn Progress) -> Result<MadeDataset, FootageError> {
    let FootageSettings { folder, out, .. } = settings;
    let is_calibrated = Dataset::format(folder).is_some();
    if !is_calibrated && plain::names(folder)?.is_empty() {
        return Err(FootageError::NoFootage { folder: folder.clone() });
    }
    output::claim(out, folder)?;
    let store = Store::beside(out, FOLDER)?;
    output::remove_unfinished(out)?;
    let mut stages = Stages::begin("footage", STAGES, &store, progress);
    let source = if is_calibrated {
        stages.leave_out("poses", None);
        Source::of_dataset(folder, stages.progress())?
    } else {
        let cameras = find_cameras(settings, &mut stages)?;
        Source::of_cameras(folder, cameras.calibration(), stages.progress())?
    };
    let source = match &settings.test {
        Some(test) => source.tested_by(test)?,
        None => source,
    };
    let made = run(settings, source, &store, &mut stages)?;
    stages.finish();
    Ok(made)
}

/// Makes the usual dataset of footage before a bake or a training to the package `out`, in the folder of results of a
/// bake, and reports the verdict. Returns the folder of the dataset.
///
/// # Errors
/// As [`footage`].
pub fn prepared(folder: &Path, out: &Path, progress: &mut dyn Progress) -> Result<PathBuf, FootageError> {
    let dataset = folder_beside(out, BAKE_FOLDER).join(DATASET);
    let made = footage(&FootageSettings::usual(folder.to_owned(), dataset.clone()), progress)?;
    let word = if made.grave { "warning" } else { "verdict" };
    progress.note(&format!("{word}: {}: {}", folder.display(), made.verdict));
    Ok(dataset)
}

/// Finds the cameras of footage without a calibration.
fn find_cameras(settings: &FootageSettings, stages: &mut Stages<'_>) -> Result<FoundCameras, FootageError> {
    let pictures = poses::pictures(&settings.folder, stages.progress())?;
    let key = version().with(poses::key(&pictures)?);
    let find = |progress: &mut dyn Progress| FoundCameras::of(&pictures, progress).map(Text);
    let (Text(found), _) = stages.run("poses", key, |_| true, find)?;
    Ok(found)
}

/// Runs the stages after the cameras are known.
fn run(
    settings: &FootageSettings,
    source: Source,
    store: &Store,
    stages: &mut Stages<'_>,
) -> Result<MadeDataset, FootageError> {
    let out = &settings.out;
    let pictures = pictures_key(&source, stages.progress())?;
    let working = working_pictures(settings, &source, pictures, store);
    let (clocks, clocks_key) = compare_clocks(settings, (&source, &working), pictures, stages)?;
    let source = timed(source, &clocks.offsets);
    let (take, names) = source.take(settings.work_size);
    let seen = (&take, &names);

    let (masked, masks_key) = separate(settings, (seen, &working), pictures, stages)?;
    let seen_key = masks_key.with(Key::of_views(&source.views()));
    let is_there = |Text(cloud): &Text<Cloud>| cloud.is_in(out) && !cloud.can_be_completed();
    let find = |progress: &mut dyn Progress| match settings.points {
        true => Cloud::write(seen, &working, source.points.as_ref(), settings, progress).map(Text),
        false => Cloud::none(out).map(Text),
    };
    let key = seen_key.and(&format!("{} {}", settings.points, settings.agreeing));
    let (Text(cloud), cloud_key) = stages.run("points", key, is_there, find)?;

    let key = seen_key.with(cloud_key).and(&format!("{:?}", source.clock));
    let is_there = |Text(written): &Text<Written>| written.is_in(out);
    let write = |progress: &mut dyn Progress| Written::of(&source, cloud.file(), out, progress).map(Text);
    stages.run("dataset", key, is_there, write)?;
    let (rehearsed, rehearsal_key) = rehearse(settings, (&source, &take), (&cloud, key), stages)?;

    let key = seen_key.with(clocks_key).with(rehearsal_key);
    let is_there = |Text(judged): &Text<Judged>| judged.is_in(out);
    let judge = |progress: &mut dyn Progress| {
        Judged::write(seen, &working, (&source, &clocks), rehearsed, out, progress).map(Text)
    };
    let (Text(judged), _) = stages.run("verdict", key, is_there, judge)?;
    working.remove()?;

    let frames = source.shots.iter().filter(|shot| shot.split == Split::Train).count();
    Ok(MadeDataset {
        frames,
        test_frames: source.shots.len() - frames,
        moments: take.moments.len(),
        sync: clocks.way,
        offsets: clocks.offsets,
        masks: masked.masks(),
        points: cloud.points,
        grave: judged.grave,
        verdict_json: judged.json(),
        verdict: judged.text,
        stages: stages.times(),
        cameras: source.cameras.clone(),
    })
}

/// Returns the key of the pictures of footage with their cameras, names and splits, but without times.
fn pictures_key(source: &Source, progress: &mut dyn Progress) -> Result<Key, FootageError> {
    let views = source.views();
    let images = Key::of_images(&views, progress)?;
    let shots = source.shots.iter().map(|Shot { view, split, camera, name }| {
        Key::of(format!("{:?} {:?} {split:?} {camera} {name}", view.camera, view.original).as_bytes())
    });
    let points: Vec<&Path> = source.points.iter().map(|(path, _)| path.as_path()).collect();
    let all = shots.fold(version().with(images), Key::with).with(Key::of_files(&points)?);
    Ok(all.and(&format!("{:?}", source.cameras)))
}

/// Returns the pictures to work with of the cameras to train on, if they are larger than that: at the work size, and at
/// the sizes at which the verdict and the comparison of motion look at them. `pictures` is the key of the pictures.
fn working_pictures(settings: &FootageSettings, source: &Source, pictures: Key, store: &Store) -> WorkingPictures {
    let sizes = |camera: &Camera| {
        let work = reduced(camera, settings.work_size);
        [work, reduced(&work, LONGEST), reduced(camera, SIDE)].map(|camera| camera.size)
    };
    let is_large = |view: &TrainingView| view.original.max_element() > settings.work_size;
    let trained = source.shots.iter().filter(|shot| shot.split == Split::Train).map(|shot| &shot.view);
    let wanted = trained.filter(|view| is_large(view)).map(|view| (view, sizes(&view.camera)));
    WorkingPictures::new(store.folder().join(PICTURES), pictures, wanted)
}

/// Returns the key of the version of this crate.
fn version() -> Key {
    Key::of(env!("CARGO_PKG_VERSION").as_bytes())
}

/// Runs the stage sync. `pictures` is the key of the pictures.
fn compare_clocks(
    settings: &FootageSettings,
    (source, working): (&Source, &WorkingPictures),
    pictures: Key,
    stages: &mut Stages<'_>,
) -> Result<(Clocks, Key), FootageError> {
    let videos = clocks::videos(source, &settings.folder)?;
    let videos: Vec<&Path> = videos.iter().flatten().map(PathBuf::as_path).collect();
    let key = pictures.with(Key::of_views(&source.views())).with(Key::of_files(&videos)?);
    let key = key.and(&format!("{:?} {:?}", settings.sync, settings.offsets));
    let compare = |progress: &mut dyn Progress| Clocks::of(source, settings, working, progress).map(Text);
    let is_final = |Text(clocks): &Text<Clocks>| !clocks.is_provisional;
    let (Text(clocks), key) = stages.run("sync", key, is_final, compare)?;
    Ok((clocks, key))
}

/// Runs the stage plates: tells what moves from what stands still. `pictures` is the key of the pictures. Returns the
/// key of all that plates and masks depend on: their list has sizes alone.
fn separate(
    settings: &FootageSettings,
    (seen, working): ((&Take, &Names<'_>), &WorkingPictures),
    pictures: Key,
    stages: &mut Stages<'_>,
) -> Result<(Masked, Key), FootageError> {
    let out = &settings.out;
    let given = Given::of(settings.masks.as_deref(), &settings.folder);
    let files = given.as_ref().map_or(Ok(Vec::new()), |given| given.files(seen))?;
    let note = given.as_ref().filter(|_| !files.is_empty()).map(|given| given.note(files.len()));
    note.iter().for_each(|note| stages.progress().note(note));
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let key =
        pictures.with(Key::of_files(&paths)?).and(&format!("{} {} {paths:?}", settings.work_size, settings.smallest));
    let is_there = |Text(masked): &Text<Masked>| masked.is_in(out);
    let write =
        |progress: &mut dyn Progress| masking::write_masks(seen, working, given.as_ref(), settings, progress).map(Text);
    let (Text(masked), _) = stages.run("plates", key, is_there, write)?;
    Ok((masked, key))
}

/// Runs the stage rehearsal, if it is asked for and a camera can be held out. `dataset` is the key of the dataset.
/// Returns what it has reached, and the key of that.
fn rehearse(
    settings: &FootageSettings,
    (source, take): (&Source, &Take),
    (cloud, dataset): (&Cloud, Key),
    stages: &mut Stages<'_>,
) -> Result<(Option<Rehearsed>, Key), FootageError> {
    let few = (take.cameras.len() < 2).then_some("only one camera is trained on, and none can be held out");
    if !settings.rehearse || few.is_some() {
        stages.leave_out("rehearsal", few.filter(|_| settings.rehearse));
        return Ok((None, Key::of(b"no rehearsal")));
    }
    let has_points = cloud.file().is_some();
    let rehearse = |progress: &mut dyn Progress| Rehearsed::of(source, has_points, &settings.out, progress).map(Text);
    let (Text(rehearsed), key) = stages.run("rehearsal", dataset, |_| true, rehearse)?;
    Ok((rehearsed, key))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use glam::{DMat4, DVec4, UVec2, Vec3};
    use image::{Rgb, RgbImage};
    use serde_json::json;
    use std::fs;

    /// Is interrupted from the beginning of a task on.
    struct Interrupting {
        task: &'static str,
        is_reached: bool,
    }

    impl Progress for Interrupting {
        fn begin(&mut self, task: &'static str, _steps: usize) {
            self.is_reached |= task == self.task;
        }

        fn advance(&mut self) {}

        fn finish(&mut self) {}

        fn note(&mut self, _line: &str) {}

        fn is_interrupted(&self) -> bool {
            self.is_reached
        }
    }

    /// Writes a dataset of three cameras with five pictures each.
    fn write(folder: &Path) {
        let size = UVec2::new(64, 48);
        let mut frames = Vec::new();
        for camera in 0..3 {
            let eye = Vec3::new(3.0, camera as f32 - 1.0, 1.0);
            let pose = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.8, size).world_to_camera.as_dmat4();
            let to_world = pose.inverse() * DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
            let rows: Vec<[f64; 4]> = (0..4).map(|row| to_world.row(row).to_array()).collect();
            fs::create_dir_all(folder.join(format!("{camera}"))).expect("the folder can be made");
            for frame in 0..5 {
                let file = format!("{camera}/{frame}.png");
                let picture = RgbImage::from_fn(size.x, size.y, |x, y| {
                    let moves = x.abs_diff(12 + 10 * frame) < 4 && y.abs_diff(24) < 4;
                    let noise = (x * 7 + y * 13 + camera * 5) * 40_503 / 8 % 32;
                    if moves { Rgb([250, 240, 30]) } else { Rgb([80 + noise as u8; 3]) }
                });
                picture.save(folder.join(&file)).expect("the folder can be written to");
                let time = f64::from(frame) / 4.0;
                let split = if camera == 0 { "test" } else { "train" };
                frames.push(json!({ "file_path": file, "time": time, "split": split, "transform_matrix": rows }));
            }
        }
        let file = json!({ "camera_angle_x": 0.8, "w": size.x, "h": size.y, "frames": frames });
        fs::write(folder.join("transforms.json"), file.to_string()).expect("the folder can be written to");
    }

    #[test]
    fn an_interrupted_run_leaves_nothing_half_written_and_resumes() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [room, out] = ["room", "out"].map(|name| folder.path().join(name));
        fs::create_dir(&room).expect("the folder can be made");
        write(&room);
        let settings = FootageSettings { work_size: 48, ..FootageSettings::usual(room, out.clone()) };
        let names = || -> Vec<String> {
            let entries = fs::read_dir(&out).expect("the folder can be listed").flatten();
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
        };
        for (task, missing) in [("hashing images", "plates"), ("plates and masks", "plates"), ("pictures", "images")] {
            let mut progress = Interrupting { task, is_reached: false };
            let error = footage(&settings, &mut progress).expect_err("it is interrupted").to_string();
            assert_eq!(error, "interrupted", "at the task {task}");
            let is_whole = |name: &String| name != missing && !name.starts_with(".gs4d-");
            assert!(names().iter().all(is_whole), "at the task {task}: {:?}", names());
        }
        let working = folder.path().join("out.footage/pictures");
        let stored = fs::read_dir(&working).expect("the pictures to work with are kept for the next run").count();
        assert_eq!(stored, 10, "those of the cameras to train on, at the work size");
        let made = footage(&settings, &mut NoProgress).expect("nobody interrupts");
        assert!(!working.exists(), "nobody needs them any more");
        assert_eq!((made.frames, made.test_frames, made.moments), (10, 5, 5), "two cameras to train on");
        let skipped: Vec<bool> = made.stages.iter().map(|stage| stage.skipped).collect();
        assert_eq!(skipped, [true, true, true, false, false], "the stages that were done are not done again");
        assert_eq!(made.masks, 10, "a mask for each picture to train on");
    }
}
