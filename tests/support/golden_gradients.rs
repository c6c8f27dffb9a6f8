//! The golden gradients: gradients of a loss on a golden view with respect to the raw tensors of its scene.
//!
//! In: `tests/golden/<scene>/<view>.grad.json`, computed in double precision; its `compat` has the results of the
//! original CUDA code. Out: [`GoldenGradient`]s, each with a view, its trained scene, the loss and the expected
//! gradients.

use crate::support::golden::{self, GoldenView};
use bevy_gs4d::gaussian::{GradientMode, SliceSettings};
use bevy_gs4d::internal::gaussian::ParameterGradient;
use bevy_gs4d::internal::reference::PixelGradients;
use bevy_gs4d::scene::Trained;
use glam::Vec3;
use serde_json::Value;
use std::path::Path;

/// The gradients of a loss on one golden view. The loss is a weighted sum of color, depth and alpha of every pixel.
pub struct GoldenGradient {
    pub golden: GoldenView,
    /// The trained scene of the view before slicing, with the degrees of the view.
    pub trained: Trained,
    pub slice: SliceSettings,
    /// Weights of the color of each pixel.
    color: Vec<Vec3>,
    /// Weights of the expected depth of each pixel.
    depth: Vec<f32>,
    /// Weights of the alpha of each pixel.
    alpha: Vec<f32>,
    json: Value,
}

/// Returns the five golden gradients.
pub fn all_gradients() -> Vec<GoldenGradient> {
    let gradients: Vec<_> = golden::all_views().into_iter().filter_map(load).collect();
    assert_eq!(gradients.len(), 5, "five golden views have gradients");
    gradients
}

/// Returns the gradients of a view; `None` if the view has none.
fn load(golden: GoldenView) -> Option<GoldenGradient> {
    let (scene, view) = golden.name.split_once('/').expect("the name has a scene and a view");
    let folder = golden::folder().join(scene);
    let path = folder.join(format!("{view}.grad.json"));
    let json = path.exists().then(|| read(&path))?;
    let weights = |key: &str| golden::floats(&folder.join(json[key].as_str().expect("the weights name a file")));
    let (planes, count) = (weights("w_color"), golden.alpha.len());
    let color = (0..count).map(|i| Vec3::new(planes[i], planes[count + i], planes[2 * count + i])).collect();
    let (parameters, _) = golden::raw_scene(&read(&folder.join("scene.json")));
    let harmonics = golden.scene.form.harmonics().expect("the scene is sliced").clone();
    // All views with gradients have the default scale modifier.
    let slice = SliceSettings { prefilter_var: golden.scene.trained_with.prefilter_var, ..SliceSettings::default() };
    let (depth, alpha) = (weights("w_depth"), weights("w_alpha"));
    let trained = Trained { parameters, harmonics };
    Some(GoldenGradient { golden, trained, slice, color, depth, alpha, json })
}

fn read(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

impl GoldenGradient {
    /// Returns the gradient of the loss with respect to each pixel.
    pub fn pixels(&self) -> PixelGradients<'_> {
        PixelGradients { color: &self.color, depth: &self.depth, alpha: &self.alpha }
    }

    /// Returns the names of the raw tensors with the expected gradients of all Gaussians.
    pub fn expected(&self, mode: GradientMode) -> Vec<(&str, Vec<f64>)> {
        let key = match mode {
            GradientMode::Exact => "exact",
            GradientMode::Compat => "compat",
        };
        let tensors = self.json[key]["raw"].as_object().expect("the file has gradients of this mode");
        tensors.iter().map(|(name, values)| (name.as_str(), numbers(values))).collect()
    }
}

/// Returns the numbers in nested arrays, in order.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        value => vec![value.as_f64().expect("the value is a number")],
    }
}

/// Returns the gradients of all Gaussians with respect to the raw tensor `name`.
pub fn tensor(name: &str, gradients: &[ParameterGradient]) -> Vec<f64> {
    let of_one = |gradient: &ParameterGradient| match name {
        "xyz" => gradient.mean.to_vec(),
        "t" => vec![gradient.mean_t],
        "scaling" => gradient.log_scale.to_vec(),
        "scaling_t" => vec![gradient.log_scale_t],
        "rotation" => gradient.rotation_l.to_vec(),
        "rotation_r" => gradient.rotation_r.to_vec(),
        "opacity" => vec![gradient.opacity_logit],
        "features_dc" => gradient.harmonics[..3].to_vec(),
        "features_rest" => gradient.harmonics[3..].to_vec(),
        _ => panic!("no tensor is called {name}"),
    };
    gradients.iter().flat_map(of_one).collect()
}
