//! The golden scenes: parameters, cameras and pictures of five tiny scenes, checked against the original CUDA code.
//!
//! In: `tests/golden/<scene>/`. Out: [`GoldenView`]s, each a runtime scene, a view and the expected frame.

use bevy_gs4d::gaussian::{Harmonics, Parameters, ShDirection, SliceSettings};
use bevy_gs4d::scene::{Environment, GaussianScene, PlaybackHints, RuntimeScene, SceneForm, Trained, TrainedWith};
use bevy_gs4d::view::{Background, Camera, Frame, Lens, RasterFov, View};
use glam::{Mat4, UVec2, Vec2};
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Names of the golden scenes, each a folder of `tests/golden/`.
pub const SCENES: [&str; 5] = ["rot4d_sh3_t2", "nonrot4d_sh3_t1", "static_l_eq_r", "static_as_3d", "intrinsics_env"];

/// One view of a golden scene.
pub struct GoldenView {
    pub name: String,
    pub scene: RuntimeScene,
    pub view: View,
    pub background: Background,
    /// The output of the original code: planar color, depth, alpha.
    pub color: Vec<f32>,
    pub depth: Vec<f32>,
    pub alpha: Vec<f32>,
    /// Pixels at which a value is too close to a threshold, as a flag for each pixel.
    pub ambiguous: Vec<u8>,
}

#[derive(Deserialize)]
struct CameraEntry {
    view: [[f32; 4]; 4],
    full: [[f32; 4]; 4],
    width: u32,
    height: u32,
    timestamp: f32,
    tanfovx: f32,
    tanfovy: f32,
    campos: [f32; 3],
    cx: Option<f32>,
    cy: Option<f32>,
    fl_x: Option<f32>,
    fl_y: Option<f32>,
}

/// Returns the folder of the golden scenes.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

/// Returns the sixteen views of all golden scenes.
pub fn all_views() -> Vec<GoldenView> {
    let views: Vec<_> = SCENES.iter().flat_map(|scene| load(scene)).collect();
    assert_eq!(views.len(), 16, "the five scenes have sixteen views");
    views
}

/// Reads a file of float32 values.
pub fn floats(path: &Path) -> Vec<f32> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

fn load(name: &str) -> Vec<GoldenView> {
    let folder = folder().join(name);
    let text = std::fs::read_to_string(folder.join("scene.json")).expect("scene.json can be read");
    let json: Value = serde_json::from_str(&text).expect("scene.json is JSON");
    let views = json["views"].as_array().expect("scene.json has views");
    views.iter().map(|view| load_view(&folder, name, &json, view)).collect()
}

fn load_view(folder: &Path, scene_name: &str, json: &Value, view: &Value) -> GoldenView {
    let option = |key: &str| match &view["options"][key] {
        Value::Null => json["options"][key].clone(),
        value => value.clone(),
    };
    let number = |key: &str, default: f64| option(key).as_f64().unwrap_or(default);
    let span = number("time_span", 1.0) as f32;
    let trained_with = TrainedWith {
        time_interval: [0.0, span],
        background: serde_json::from_value(option("bg")).expect("the background is a color"),
        sh_direction: if option("sh_dir") == "displaced" { ShDirection::Displaced } else { ShDirection::Canonical },
        prefilter_var: number("prefilter_var", -1.0) as f32,
        ..TrainedWith::default()
    };
    let (parameters, mut harmonics) = raw_scene(json);
    harmonics.degree = number("sh_degree", 3.0) as u32;
    let flat = option("force_sh_3d") == true || number("gaussian_dim", 4.0) == 3.0 || harmonics.degree < 3;
    harmonics.degree_t = if flat { 0 } else { number("sh_degree_t", 0.0) as u32 };
    let environment = json["env_file"].as_str().map(|file| {
        let side = json["env_res"].as_u64().expect("env_res is a number") as u32;
        Environment { width: side, height: side, texels: floats(&folder.join(file)) }
    });
    let settings = SliceSettings {
        scale_modifier: number("scale_modifier", 1.0) as f32,
        prefilter_var: trained_with.prefilter_var,
    };
    let scene = GaussianScene {
        form: SceneForm::Trained(Trained { parameters, harmonics }),
        environment,
        filter: None,
        trained_with,
        playback: PlaybackHints::default(),
        levels: Vec::new(),
        sockets: Vec::new(),
        colliders: None,
        sound: None,
        chunks: None,
    }
    .into_runtime_with(&settings)
    .expect("golden scenes are valid");
    let camera: CameraEntry = serde_json::from_value(view["camera"].clone()).expect("the view has a camera");
    let file = |key: &str| folder.join(view[key].as_str().expect("the view names its files"));
    GoldenView {
        name: format!("{scene_name}/{}", view["name"].as_str().expect("the view has a name")),
        background: scene.trained_background(),
        scene,
        view: make_view(&camera),
        color: floats(&file("color_file")),
        depth: floats(&file("depth_file")),
        alpha: floats(&file("alpha_file")),
        ambiguous: std::fs::read(file("ambiguous_file")).expect("the flags of ambiguous pixels can be read"),
    }
}

/// Returns the raw tensors of a golden scene, and its colors with all degrees.
pub fn raw_scene(json: &Value) -> (Parameters, Harmonics) {
    let raw = &json["raw"];
    fn get<T: serde::de::DeserializeOwned + Default>(raw: &Value, key: &str) -> T {
        match &raw[key] {
            Value::Null => T::default(),
            value => serde_json::from_value(value.clone()).unwrap_or_else(|error| panic!("{key}: {error}")),
        }
    }
    let column = |key: &str| get::<Vec<[f32; 1]>>(raw, key).into_iter().map(|[v]| v).collect::<Vec<f32>>();
    let dc: Vec<Vec<[f32; 3]>> = get(raw, "features_dc");
    let rest: Vec<Vec<[f32; 3]>> = get(raw, "features_rest");
    let coefficients = 1 + rest.first().map_or(0, Vec::len);
    let values = dc.iter().zip(&rest).flat_map(|(a, b)| a.iter().chain(b).flatten().copied()).collect();
    let parameters = Parameters {
        mean: get(raw, "xyz"),
        mean_t: column("t"),
        log_scale: get(raw, "scaling"),
        log_scale_t: column("scaling_t"),
        rotation_l: get(raw, "rotation"),
        rotation_r: get(raw, "rotation_r"),
        opacity_logit: column("opacity"),
    };
    (parameters, Harmonics { coefficients, degree: 3, degree_t: 0, values })
}

/// Builds the view from the lens and checks it against the stored matrices.
fn make_view(entry: &CameraEntry) -> View {
    let rows = |m: &[[f32; 4]; 4]| Mat4::from_cols_array_2d(m).transpose();
    let size = UVec2::new(entry.width, entry.height);
    let tan = Vec2::new(entry.tanfovx, entry.tanfovy);
    let (lens, raster_fov) = match (entry.fl_x, entry.fl_y, entry.cx, entry.cy) {
        (Some(fl_x), Some(fl_y), Some(cx), Some(cy)) => (
            Lens::Intrinsics { focal: Vec2::new(fl_x, fl_y), center: Vec2::new(cx, cy) },
            if entry.tanfovx < 0.0 { RasterFov::Reference } else { RasterFov::Corrected },
        ),
        _ => (Lens::Fov { tan }, RasterFov::Reference),
    };
    let view = Camera { world_to_camera: rows(&entry.view), size, lens }.view(entry.timestamp, raster_fov);
    let full = rows(&entry.full);
    for (ours, theirs) in view.clip_rows().into_iter().zip([full.row(0), full.row(1)]) {
        assert!(ours.abs_diff_eq(theirs, 1e-5), "the projection {ours} equals the stored {theirs}");
    }
    assert!(
        view.camera_position.abs_diff_eq(entry.campos.into(), 1e-5),
        "the camera position equals the stored position"
    );
    assert!(view.tan_fov.abs_diff_eq(tan, 1e-6), "the tangents {} equal the stored {tan}", view.tan_fov);
    view
}

/// Returns the largest absolute differences: of color, depth and alpha outside of the ambiguous pixels, and of color or
/// alpha in ambiguous pixels, where a splat at a threshold may or may not count.
pub fn differences(golden: &GoldenView, frame: &Frame) -> ([f32; 3], f32) {
    let count = golden.alpha.len();
    let (mut clear, mut ambiguous) = ([0.0f32; 3], 0.0f32);
    for i in 0..count {
        let color =
            (0..3).map(|c| (golden.color[c * count + i] - frame.picture.pixels[i][c]).abs()).fold(0.0, f32::max);
        let depth = (golden.depth[i] - frame.depth[i]).abs();
        let alpha = (golden.alpha[i] - (1.0 - frame.transmittance[i])).abs();
        if golden.ambiguous[i] == 0 {
            for (worst, value) in clear.iter_mut().zip([color, depth, alpha]) {
                *worst = worst.max(value);
            }
        } else {
            ambiguous = ambiguous.max(color).max(alpha);
        }
    }
    (clear, ambiguous)
}
