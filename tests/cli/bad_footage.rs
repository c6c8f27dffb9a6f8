//! The verdict of `footage` on footage that something is wrong with.
//!
//! In: the treadmill, filmed by four cameras (`real/treadmill` in the folder that `GS4D_DATA` names), at a sixth of its
//! size and half of its rate, which the installed `ffmpeg` makes once. Out: proof that each fault, put into a copy of
//! it, is named with the camera that has it, and that the unchanged take has no grave finding.

use crate::support::command::{arguments, folder, gs4d};
use crate::support::data::data;
use crate::support::skip::skip;
use image::RgbImage;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

const CAMERAS: [&str; 4] = ["cam01", "cam02", "cam03", "cam04"];
/// The folder of the pictures of the last camera that zooms.
const ZOOMED: &str = "zoomed";
/// Frames of a camera, and frames a second.
const FRAMES: usize = 50;
const RATE: f64 = 30.0;
/// Size of the pictures, and the factor from the videos to it. Videos that are wider are cut at the right.
const SIZE: [u32; 2] = [180, 320];
const FACTOR: f64 = 1.0 / 6.0;
/// Every second frame, cut to the width of the narrowest video, at a sixth of its size.
const REDUCED: &str = "select=not(mod(n\\,2)),crop=1080:1920:0:0,scale=180:320:flags=area";
/// From frame 30 on, to 1.03 times the size at the last frame.
const ZOOMS: &str = "zoompan=z='1+0.0018*max(0\\,on-30)':x='iw/2-iw/zoom/2':y='ih/2-ih/zoom/2':d=1:s=180x320";

/// What a camera shows in a frame.
#[derive(Clone, Copy)]
enum Shows {
    /// A frame of its video.
    Frame(usize),
    /// The same, zoomed. Of the last camera.
    Zoomed(usize),
    Black,
    /// Its video has ended.
    Nothing,
}
use Shows::{Black, Frame, Nothing, Zoomed};

/// Returns the folder of the videos, if they and the program are there; else reports the skipped test.
fn videos() -> Option<PathBuf> {
    let videos = data()?.join("real/treadmill");
    if !videos.is_dir() {
        skip(format!("no footage: {} is not there", videos.display()));
        return None;
    }
    if Command::new("ffmpeg").arg("-version").output().is_err() {
        skip("ffmpeg is not installed");
        return None;
    }
    Some(videos)
}

/// Returns the folder of the reduced pictures, which are made once.
fn pictures(videos: &Path) -> PathBuf {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    let make = || {
        let place = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let pictures = place.join("treadmill-180x320");
        if !pictures.is_dir() {
            let made = tempfile::tempdir_in(place).expect("a temporary folder");
            for camera in CAMERAS {
                reduce(&videos.join(format!("{camera}.mp4")), REDUCED, &made.path().join(camera));
            }
            let last = made.path().join(CAMERAS[3]).join("%03d.jpg");
            reduce(&last, ZOOMS, &made.path().join(ZOOMED));
            // The folder is there if another run has just made it.
            let renamed = fs::rename(made.path(), &pictures);
            assert!(renamed.is_ok() || pictures.is_dir(), "the pictures are put into place: {renamed:?}");
        }
        pictures
    };
    MADE.get_or_init(make).clone()
}

/// Writes the pictures of a video, or of numbered pictures, to a new folder.
fn reduce(from: &Path, filter: &str, to: &Path) {
    fs::create_dir(to).expect("the folder can be made");
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-nostdin"]);
    if from.extension().is_some_and(|extension| extension == "jpg") {
        command.args(["-start_number", "0"]);
    }
    command.arg("-i").arg(from).args(["-vf", filter, "-fps_mode", "passthrough"]);
    command.args(["-start_number", "0", "-q:v", "2"]).arg(to.join("%03d.jpg"));
    let output = command.output().expect("ffmpeg starts");
    assert!(output.status.success(), "{}: {}", to.display(), String::from_utf8_lossy(&output.stderr));
    let count = fs::read_dir(to).expect("the folder can be listed").count();
    assert_eq!(count, FRAMES, "pictures of {}", to.display());
}

/// Footage with a fault.
struct Take {
    /// Number of cameras.
    cameras: usize,
    /// Number of frames, and every how many frames of the videos there is one.
    frames: usize,
    step: usize,
    /// The degrees by which the calibration of the second camera is turned around the camera's y axis.
    turned: f64,
    /// Longest side of the pictures that `gs4d footage` works with, pixels.
    work_size: u32,
}

/// A few frames of four cameras, in small pictures.
const FEW: Take = Take { cameras: 4, frames: 25, step: 2, turned: 0.0, work_size: 160 };
/// The same with masks as fine as the pictures.
const FINE: Take = Take { work_size: 320, ..FEW };

impl Take {
    /// Writes the footage, in which a camera shows at the frame of a number what `shows` says; `None` if the videos are
    /// not there.
    fn write(&self, folder: &Path, shows: impl Fn(usize, usize) -> Shows) -> Option<()> {
        let videos = videos()?;
        let pictures = pictures(&videos);
        let text = fs::read_to_string(videos.join("cameras_opencv.json")).expect("the cameras are beside the videos");
        let calibration: Vec<Value> = serde_json::from_str(&text).expect("a list of cameras");
        let mut frames = Vec::new();
        for (camera, name) in CAMERAS.iter().enumerate().take(self.cameras) {
            fs::create_dir_all(folder.join(name)).expect("the folder can be made");
            for frame in 0..self.frames {
                let copied = |from: &str, number: usize| {
                    let file = format!("{name}/{frame:03}.jpg");
                    let from = pictures.join(from).join(format!("{number:03}.jpg"));
                    fs::copy(from, folder.join(&file)).expect("the picture is there");
                    file
                };
                let file = match shows(camera, frame) {
                    Frame(number) => copied(name, number),
                    Zoomed(number) => copied(ZOOMED, number),
                    Black => {
                        let file = format!("{name}/{frame:03}.png");
                        let black = RgbImage::new(SIZE[0], SIZE[1]).save(folder.join(&file));
                        black.expect("the folder can be written to");
                        file
                    }
                    Nothing => continue,
                };
                let turned = if camera == 1 { self.turned } else { 0.0 };
                frames.push(entry(&calibration[camera], &file, (frame * self.step) as f64 / RATE, turned));
            }
        }
        let file = json!({ "w": SIZE[0], "h": SIZE[1], "frames": frames });
        fs::write(folder.join("transforms.json"), file.to_string()).expect("the folder can be written to");
        Some(())
    }

    /// Returns the findings on such footage; `None` if the videos are not there.
    fn findings(&self, shows: impl Fn(usize, usize) -> Shows) -> Option<Vec<Value>> {
        let folder = folder();
        let [take, out] = ["take", "dataset"].map(|name| folder.path().join(name));
        fs::create_dir(&take).expect("the folder can be made");
        self.write(&take, shows)?;
        let size = self.work_size.to_string();
        let line = arguments!["footage", &take, "-o", &out, "--work-size", size, "--no-points", "--json"];
        let made = gs4d(&line).json();
        Some(made["verdict"]["findings"].as_array().expect("a list of findings").clone())
    }
}

/// Returns the entry of a picture in the file of cameras. Distortion, half a pixel of these pictures, is left out.
fn entry(camera: &Value, file: &str, time: f64, turned: f64) -> Value {
    let number = |name: &str| camera[name].as_f64().expect(name) * FACTOR;
    let rows = camera["c2w"].as_array().expect("the pose").iter();
    let (sin, cos) = turned.to_radians().sin_cos();
    let row = |row: &Value| -> [f64; 4] {
        let [x, y, z, place] = [0, 1, 2, 3].map(|column| row[column].as_f64().expect("a number"));
        [cos * x - sin * z, y, sin * x + cos * z, place]
    };
    json!({
        "file_path": file,
        "time": time,
        "split": "train",
        "fl_x": number("fl_x"), "fl_y": number("fl_y"), "cx": number("cx"), "cy": number("cy"),
        "transform_matrix": rows.map(row).collect::<Vec<_>>(),
    })
}

/// Returns the findings about a subject.
fn about<'a>(findings: &'a [Value], subject: &str) -> Vec<&'a Value> {
    findings.iter().filter(|finding| finding["subject"] == subject).collect()
}

/// Returns the only grave finding about a subject.
fn grave<'a>(findings: &'a [Value], subject: &str) -> &'a Value {
    let found: Vec<&Value> =
        about(findings, subject).into_iter().filter(|finding| finding["severity"] == "grave").collect();
    assert_eq!(found.len(), 1, "one grave finding about {subject}: {findings:#?}");
    found[0]
}

/// Checks that a finding is about one camera and has these words.
fn names(finding: &Value, camera: &str, words: &str) {
    assert_eq!(finding["cameras"], json!([camera]), "the camera with the fault: {finding:#}");
    let what = finding["what"].as_str().expect("a sentence");
    assert!(what.contains(camera) && what.contains(words), "{camera} and {words:?} are in: {what}");
    assert!(finding["remedy"].as_str().is_some_and(|remedy| !remedy.is_empty()), "a remedy: {finding:#}");
}

/// Returns a frame of a take with every second frame.
fn second(frame: usize) -> Shows {
    Frame(2 * frame)
}

#[test]
fn the_take_as_it_is_has_no_grave_finding() {
    let Some(findings) = FINE.findings(|_, frame| second(frame)) else { return };
    let grave: Vec<&Value> = findings.iter().filter(|finding| finding["severity"] == "grave").collect();
    assert!(grave.is_empty(), "nothing is wrong: {grave:#?}");
    for subject in ["blank", "moments", "pictures", "zoom", "bump", "synchrony"] {
        let found = about(&findings, subject);
        assert!(found.is_empty(), "nothing is said about {subject}: {found:#?}");
    }
}

#[test]
fn a_single_camera_is_named() {
    let take = Take { cameras: 1, ..FEW };
    let Some(findings) = take.findings(|_, frame| second(frame)) else { return };
    names(grave(&findings, "cameras"), "cam01", "one camera");
}

#[test]
fn a_camera_that_is_three_frames_early_is_named() {
    let take = Take { frames: FRAMES - 3, step: 1, ..FEW };
    let shows = |camera: usize, frame: usize| Frame(if camera == 1 { frame + 3 } else { frame });
    let Some(findings) = take.findings(shows) else { return };
    let finding = grave(&findings, "synchrony");
    names(finding, "cam02", "early");
    let what = finding["what"].as_str().expect("a sentence");
    let frames = what.split(" frames").next().and_then(|before| before.rsplit(' ').next()?.parse::<f64>().ok());
    assert!(frames.is_some_and(|frames| (2.3..=3.7).contains(&frames)), "about three frames: {what}");
}

#[test]
fn a_camera_with_a_wrong_calibration_is_named() {
    let take = Take { turned: 4.0, ..FINE };
    let Some(findings) = take.findings(|_, frame| second(frame)) else { return };
    let found = about(&findings, "calibration");
    assert_eq!(found.len(), 1, "one finding: {findings:#?}");
    assert_ne!(found[0]["severity"], "note", "it is not only said that nothing was checked: {found:#?}");
    // Of four cameras, two may be in question.
    let cameras = found[0]["cameras"].as_array().expect("a list of names");
    assert!(cameras.len() <= 2 && cameras.contains(&json!("cam02")), "the turned camera: {found:#?}");
}

#[test]
fn a_lens_cap_is_named() {
    let shows = |camera, frame| if camera == 2 { Black } else { second(frame) };
    let Some(findings) = FEW.findings(shows) else { return };
    names(grave(&findings, "blank"), "cam03", "lens covered");
}

#[test]
fn a_zoom_during_the_take_is_named() {
    let shows = |camera, frame| if camera == 3 { Zoomed(2 * frame) } else { second(frame) };
    let Some(findings) = FEW.findings(shows) else { return };
    names(grave(&findings, "zoom"), "cam04", "zooms");
}

#[test]
fn a_black_start_of_all_cameras_is_one_finding() {
    let shows = |_, frame| if frame < 8 { Black } else { second(frame) };
    let Some(findings) = FEW.findings(shows) else { return };
    let finding = grave(&findings, "blank");
    assert_eq!(finding["cameras"], json!([]), "it is about all cameras: {finding:#}");
    let what = finding["what"].as_str().expect("a sentence");
    assert!(what.contains("black at the start: moments 0 to 7; 8 shows"), "the moments: {what}");
}

#[test]
fn a_video_that_ends_early_is_named() {
    let shows = |camera, frame| if camera == 0 && frame >= 15 { Nothing } else { second(frame) };
    let Some(findings) = FEW.findings(shows) else { return };
    names(grave(&findings, "moments"), "cam01", "ends early, after moment 14 of 24: 10 of 25");
}
