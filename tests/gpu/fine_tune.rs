//! The passes of training against the original's gradients and their CPU references.
//!
//! In: the golden scenes with their gradients; synthetic scenes. Out: proof that gradients, loss and optimizer are right, and that training
//! lowers the loss. Skipped where there is no GPU.

use crate::support::{golden, gpu};
use bevy_gs4d::gaussian::{GradientMode, Harmonics, Parameters};
use bevy_gs4d::offline::fine_tune::Trainer;
use bevy_gs4d::scene::{GaussianScene, SceneForm, Trained};
use serde_json::{Value, json};

/// Returns the tensors of a scene or its gradients, each as one list, by name.
fn tensors(parameters: &Parameters, harmonics: &Harmonics) -> Vec<(&'static str, Vec<f32>)> {
    vec![
        ("mean", parameters.mean.as_flattened().to_vec()),
        ("mean_t", parameters.mean_t.clone()),
        ("log_scale", parameters.log_scale.as_flattened().to_vec()),
        ("log_scale_t", parameters.log_scale_t.clone()),
        ("rotation_l", parameters.rotation_l.as_flattened().to_vec()),
        ("rotation_r", parameters.rotation_r.as_flattened().to_vec()),
        ("opacity_logit", parameters.opacity_logit.clone()),
        ("harmonics", harmonics.values.clone()),
    ]
}

/// Returns the norm of the difference relative to that of the expected values, or the norm itself if these are zero.
fn relative_error(found: &[f32], expected: &[f32]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let error = norm(&mut found.iter().zip(expected).map(|(a, b)| f64::from(*a) - f64::from(*b)));
    let size = norm(&mut expected.iter().map(|v| f64::from(*v)));
    if size > 0.0 { error / size } else { error }
}

fn trained(scene: &GaussianScene) -> &Trained {
    let SceneForm::Trained(trained) = &scene.form else { panic!("the trained form") };
    trained
}

#[test]
fn gradients_are_those_of_the_original() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut compared = 0;
    for golden in golden::all_views() {
        let (scene_name, view_name) = golden.name.split_once('/').expect("scene and view");
        let folder = golden::folder().join(scene_name);
        let Ok(text) = std::fs::read_to_string(folder.join(format!("{view_name}.grad.json"))) else { continue };
        let expected: Value = serde_json::from_str(&text).expect("JSON");
        let json: Value =
            serde_json::from_str(&std::fs::read_to_string(folder.join("scene.json")).expect("scene.json"))
                .expect("JSON");
        let (parameters, harmonics) = golden::raw_scene(&json);
        let degrees = golden.scene.form.color_degrees();
        let harmonics = Harmonics { degree: degrees.degree, degree_t: degrees.degree_t, ..harmonics };
        let scene = GaussianScene {
            form: SceneForm::Trained(Trained { parameters, harmonics }),
            environment: golden.scene.environment.clone(),
            filter: None,
            trained_with: golden.scene.trained_with.clone(),
            playback: golden.scene.playback,
        };
        let weights = |key: &str| golden::floats(&folder.join(expected[key].as_str().expect("a file")));
        let (color, depth, alpha) = (weights("w_color"), weights("w_depth"), weights("w_alpha"));
        let count = alpha.len();
        let pixels: Vec<[f32; 4]> =
            (0..count).map(|i| [color[i], color[count + i], color[2 * count + i], alpha[i]]).collect();
        for (mode, name) in [(GradientMode::Exact, "exact"), (GradientMode::Compat, "compat")] {
            let mut trainer = Trainer::new(&mut headless, scene.clone(), mode).expect("the scene can be trained");
            trainer.accumulate_pixels(&golden.view, golden.background, &pixels, &depth).expect("the picture fits");
            let gradients = trainer.gradients().expect("they can be read");
            let found = trained(&gradients);
            let (parameters, harmonics) = golden::raw_scene(&json!({ "raw": expected[name]["raw"] }));
            let expected = tensors(&parameters, &harmonics);
            for ((tensor, found), (_, expected)) in tensors(&found.parameters, &found.harmonics).iter().zip(&expected) {
                let error = relative_error(found, expected);
                println!("{:28} {name:7} {tensor:14} {error:.1e}", golden.name);
                assert_eq!(found.len(), expected.len(), "{}: {tensor}", golden.name);
                assert!(error <= 1e-3, "{}, {name}: {tensor} differs by {error:.1e}", golden.name);
                compared += 1;
            }
            assert_eq!(trainer.faults().expect("they can be read"), None, "every gradient is finite");
        }
    }
    assert_eq!(compared, 2 * 5 * 8, "five views have gradients");
}
