//! The CPU reference against the original implementation, on all golden views.
//!
//! In: the scenes of `tests/golden/`. Out: proof that pictures, radii and tile rectangles match the original.

use crate::support::golden::{self, GoldenView};
use bevy_gs4d::internal::gaussian;
use bevy_gs4d::reference;
use serde_json::Value;

/// The CPU reference computes in f32 as the original does: sums differ by some units in the last place, and pixels
/// where a decision is within rounding by 1/255. The largest differences are 9e-7 of color, 3e-6 of depth, 8e-7 of
/// alpha.
#[test]
fn the_cpu_reference_matches_the_original() {
    for golden in golden::all_views() {
        let frame = reference::render(&golden.scene, &golden.view, golden.background);
        let ([color, depth, alpha], ambiguous) = golden::differences(&golden, &frame);
        println!("{:32} color {color:.1e} depth {depth:.1e} alpha {alpha:.1e} ambiguous {ambiguous:.1e}", golden.name);
        assert!(color <= 5e-6, "{}: color differs by {color}", golden.name);
        assert!(depth <= 2e-5, "{}: depth differs by {depth}", golden.name);
        assert!(alpha <= 5e-6, "{}: alpha differs by {alpha}", golden.name);
        assert!(ambiguous <= 1.0 / 255.0, "{}: ambiguous pixels differ by {ambiguous}", golden.name);
    }
}

/// Returns the radii, tile rectangles and visibility that the original computes for each Gaussian of a view.
fn gaussians(golden: &GoldenView) -> Value {
    let (scene, name) = golden.name.split_once('/').expect("a scene and a view");
    let text = std::fs::read_to_string(golden::folder().join(scene).join("scene.json")).expect("scene.json");
    let json: Value = serde_json::from_str(&text).expect("JSON");
    let view = json["views"].as_array().and_then(|views| views.iter().find(|view| view["name"] == name));
    view.expect("the view is in its scene")["gaussians"].clone()
}

/// Radii and tile rectangles are integers and must be equal.
#[test]
fn footprints_match_the_original() {
    for golden in golden::all_views() {
        let gaussians = gaussians(&golden);
        let visible = gaussians["visible"].as_array().expect("visible");
        for (i, gaussian) in golden.scene.iter().enumerate() {
            let projected = gaussian::project(&gaussian, &golden.view);
            let expected = visible[i] == true || visible[i] == 1;
            assert_eq!(projected.is_some(), expected, "{}: Gaussian {i} is visible", golden.name);
            if let Some(projected) = projected {
                assert_eq!(gaussians["radius"][i], projected.radius, "{}: radius of {i}", golden.name);
                let rect = serde_json::json!(projected.tiles.to_array());
                assert_eq!(gaussians["tile_rect_x0y0x1y1"][i], rect, "{}: tiles of {i}", golden.name);
            }
        }
    }
}
