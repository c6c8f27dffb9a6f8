//! The renderer against the original implementation: all golden views, on the CPU and on the GPU.
#[path = "common/golden.rs"]
mod golden;
#[path = "common/gpu.rs"]
mod gpu;
#[path = "common/skip.rs"]
mod skip;

use bevy_gs4d::gaussian::projection;
use bevy_gs4d::reference;

/// The CPU twin computes in f32 as the original does: 2e-5 absolute, and 1/255 where a decision is too close to call.
#[test]
fn cpu_twin_matches_the_original() {
    for golden in golden::all_views() {
        let frame = reference::render(&golden.scene, &golden.view, golden.background);
        let ([color, depth, alpha], ambiguous) = golden::differences(&golden, &frame);
        println!("{:32} colour {color:.1e} depth {depth:.1e} alpha {alpha:.1e} ambiguous {ambiguous:.1e}", golden.name);
        assert!(color <= 2e-5, "{}: colour differs by {color}", golden.name);
        assert!(depth <= 5e-5, "{}: depth differs by {depth}", golden.name);
        assert!(alpha <= 2e-5, "{}: alpha differs by {alpha}", golden.name);
        assert!(ambiguous <= 1.0 / 255.0, "{}: ambiguous pixels differ by {ambiguous}", golden.name);
    }
}

/// Radii and tile rectangles are integers and must be equal.
#[test]
fn footprints_match_the_original() {
    for golden in golden::all_views() {
        let visible = golden.gaussians["visible"].as_array().expect("visible");
        for (i, gaussian) in golden.scene.gaussians.iter().enumerate() {
            let projected = projection::project(gaussian, &golden.view);
            let expected = visible[i] == true || visible[i] == 1;
            assert_eq!(projected.is_some(), expected, "{}: Gaussian {i} is visible", golden.name);
            if let Some(projected) = projected {
                assert_eq!(golden.gaussians["radius"][i], projected.radius, "{}: radius of {i}", golden.name);
                let rect = serde_json::json!(projected.tiles.to_array());
                assert_eq!(golden.gaussians["tile_rect_x0y0x1y1"][i], rect, "{}: tiles of {i}", golden.name);
            }
        }
    }
}

#[test]
fn gpu_matches_the_original() {
    let Some(mut headless) = gpu::headless() else { return };
    for golden in golden::all_views() {
        let capture = headless.upload(&golden.scene).expect("upload");
        let frame = headless.render(&capture, &golden.view, golden.background).expect("render");
        let ([color, depth, alpha], ambiguous) = golden::differences(&golden, &frame);
        println!("{:32} colour {color:.1e} depth {depth:.1e} alpha {alpha:.1e} ambiguous {ambiguous:.1e}", golden.name);
        assert!(color <= 1e-3, "{}: colour differs by {color}", golden.name);
        assert!(depth <= 5e-3, "{}: depth differs by {depth}", golden.name);
        assert!(alpha <= 1e-3, "{}: alpha differs by {alpha}", golden.name);
        assert!(ambiguous <= 2.0 / 255.0, "{}: ambiguous pixels differ by {ambiguous}", golden.name);
    }
}
