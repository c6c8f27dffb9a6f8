//! The renderer against the original implementation, on all golden views.
//!
//! In: the scenes of `tests/golden/`. Out: proof that the GPU's pictures match the pictures of the original, with both
//! designs of the renderer, and without subgroups. Skipped where there is no GPU.

use crate::support::{golden, gpu, limited_device};
use bevy_gs4d::renderer::{Design, Headless};

/// On a software driver the largest differences are 1e-6 of color, 4e-6 of depth and 1e-6 of alpha, as on the CPU; and
/// 4e-4 of color over an environment map, whose texel depends on the driver's inverse trigonometric functions.
#[test]
fn gpu_matches_the_original() {
    let Some(mut headless) = gpu::headless() else { return };
    for (name, design) in &Design::NAMES[1..] {
        compare_all_views(&mut headless, name, *design);
    }
}

/// Software drivers draw with subgroups; most other devices draw the global sort without them.
#[test]
fn a_device_without_subgroups_matches_the_original() {
    let Some(mut limited) = limited_device::binding(128 << 20) else { return };
    assert!(!limited.context().device.features().contains(wgpu::Features::SUBGROUP), "a device without subgroups");
    compare_all_views(&mut limited, "sort without subgroups", Design::GlobalSort);
}

/// Draws all golden views with a design, and compares them with the pictures of the original.
fn compare_all_views(headless: &mut Headless, name: &str, design: Design) {
    headless.set_design(design);
    for golden in golden::all_views() {
        let capture = headless.upload(&golden.scene).expect("upload");
        let frame = headless.render(&capture, &golden.view, golden.background).expect("render");
        let ([color, depth, alpha], ambiguous) = golden::differences(&golden, &frame);
        println!(
            "{:32} {name} color {color:.1e} depth {depth:.1e} alpha {alpha:.1e} ambiguous {ambiguous:.1e}",
            golden.name
        );
        let allowed = if golden.scene.environment.is_some() { 1e-3 } else { 1e-5 };
        assert!(color <= allowed, "{}, {name}: color differs by {color}", golden.name);
        assert!(depth <= 4e-5, "{}, {name}: depth differs by {depth}", golden.name);
        assert!(alpha <= 1e-5, "{}, {name}: alpha differs by {alpha}", golden.name);
        assert!(ambiguous <= 1.0 / 255.0, "{}, {name}: ambiguous pixels differ by {ambiguous}", golden.name);
    }
}
