//! The files of small folders of Pose2Sim, Qualisys, Record3D, Polycam, and of nerfstudio with matrices of lenses.
//!
//! In: nothing. Out: the names and the contents of the files of a folder, of which a reader changes one. Values of XML
//! have spaces around them, so that each is a word.

use image::{ImageFormat, RgbImage};
use serde_json::{Value, json};
use std::io::Cursor;

/// Number of cameras.
const CAMERAS: usize = 3;

/// Files by name.
type Files = Vec<(&'static str, Vec<u8>)>;

fn file(json: &Value) -> Vec<u8> {
    json.to_string().into_bytes()
}

/// Returns the bytes of a PNG of 40 x 30 pixels.
fn picture() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    RgbImage::new(40, 30).write_to(&mut bytes, ImageFormat::Png).expect("a picture can be encoded");
    bytes.into_inner()
}

/// Returns a calibration with frames of three cameras.
fn with_frames(name: &'static str, calibration: String) -> Files {
    let frames = ["cam0/0.png", "frames/cam1/0.png", "images/cam_02/0.png"].map(|name| (name, picture()));
    [(name, calibration.into_bytes())].into_iter().chain(frames).collect()
}

/// `Calib.toml` of Pose2Sim.
pub fn pose2sim() -> Files {
    let camera = |index: usize| {
        format!(
            "[cam{index}]\nname = \"cam{index}\"\nsize = [ 40.0 , 30.0 ]\nmatrix = [ [ 50.0 , 0.0 , 19.0 ] , [ 0.0 , 52.0 , 16.0 ] , \
             [ 0.0 , 0.0 , 1.0 ] ]\ndistortions = [ -0.01 , 0.01 , 0.001 , -0.001 ]\nrotation = [ 0.1 , 0.2 , -0.3 ]\n\
             translation = [ {index}.0 , 0.0 , 3.0 ]\nfisheye = false\n\n"
        )
    };
    let cameras: String = (0..CAMERAS).map(camera).collect();
    with_frames("Calib.toml", cameras + "[metadata]\nadjusted = false\nerror = 0.0\n")
}

/// `Calib.qca.txt` of Qualisys.
pub fn qualisys() -> Files {
    let camera = |index: usize| {
        format!(
            "<camera serial=\"cam{index}\" model=\"Miqus Video\" video_resolution=\" 1080p \" >\n\
             <fov_video left=\" 0 \" top=\" 0 \" right=\" 39 \" bottom=\" 29 \" />\n\
             <transform r11=\" 1 \" r12=\" 0 \" r13=\" 0 \" r21=\" 0 \" r22=\" 0 \" r23=\" 1 \" r31=\" 0 \" r32=\" -1 \" r33=\" 0 \" \
             x=\" {index}000 \" y=\" 2000.5 \" z=\" 0 \" />\n\
             <intrinsic focalLengthU=\" 3200 \" focalLengthV=\" 3328 \" centerPointU=\" 1216 \" centerPointV=\" 1024 \" skew=\" 0 \" \
             radialDistortion1=\" -0.01 \" radialDistortion2=\" 0.01 \" radialDistortion3=\" 0 \" tangentalDistortion1=\" 0 \" \
             tangentalDistortion2=\" 0 \" />\n</camera>\n"
        )
    };
    let cameras: String = (0..CAMERAS).map(camera).collect();
    with_frames(
        "Calib.qca.txt",
        format!(
            "<?xml version='1.0' encoding='ASCII'?>\n<calibration>\n<cameras>\n{cameras}</cameras>\n</calibration>\n"
        ),
    )
}

/// `metadata.json` of Record3D.
pub fn record3d() -> Files {
    let pose = |index: usize| json!([0.0, 0.1, 0.0, 0.9, index, 0, 3]);
    let metadata = json!({
        "w": 40, "h": 30, "K": [50.0, 0, 0, 0, 52.0, 0, 19.0, 16.0, 1], "fps": 60, "frameTimestamps": [0.0, 0.1, 0.3],
        "perFrameIntrinsicCoeffs": [[50.0, 50.0, 19.0, 16.0], [51.0, 50.0, 19.0, 16.0], [52.0, 50.0, 19.0, 16.0]],
        "poses": (0..CAMERAS).map(pose).collect::<Vec<_>>(),
    });
    let pictures = ["rgbd/0.jpg", "rgbd/1.jpg", "rgbd/2.jpg"].map(|name| (name, Vec::new()));
    [("metadata.json", file(&metadata))].into_iter().chain(pictures).collect()
}

/// The cameras of Polycam.
pub fn polycam() -> Files {
    let camera = |index: usize| {
        file(&json!({
            "fx": 50.0, "fy": 52.0, "cx": 19.0, "cy": 16.0, "width": 40, "height": 30, "blur_score": 50.0 + index as f64,
            "t_00": 1, "t_01": 0, "t_02": 0, "t_03": index, "t_10": 0, "t_11": 1, "t_12": 0, "t_13": 0.5, "t_20": 0,
            "t_21": 0, "t_22": 1, "t_23": -2.0,
        }))
    };
    vec![
        ("keyframes/corrected_cameras/0.json", camera(0)),
        ("keyframes/corrected_cameras/1.json", camera(1)),
        ("keyframes/corrected_cameras/2.json", camera(2)),
    ]
}

/// `transforms.json` with the matrix of each lens.
pub fn matrices() -> Files {
    let matrices = [
        json!([[50, 0, 19], [0, 52, 16], [0, 0, 1]]),
        json!([50, 0, 0, 0, 52, 0, 19, 16, 1]),
        json!({"fx": 50, "fy": 52, "cx": 19, "cy": 16}),
    ];
    let frame = |(index, matrix): (usize, Value)| {
        json!({
            "file_path": format!("images/f{index}.png"), "K": matrix,
            "transform_matrix": [[1, 0, 0, index], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]],
        })
    };
    let frames: Vec<Value> = matrices.into_iter().enumerate().map(frame).collect();
    let whole = json!({"w": 40, "h": 30, "intrinsics": [60, 61, 20, 15], "frames": frames});
    vec![("transforms.json", file(&whole))]
}
