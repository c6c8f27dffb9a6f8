//! The renderer against the original implementation, on all golden views.
//!
//! In: the scenes of `tests/golden/`. Out: proof that the GPU's pictures match the pictures of the original, with both
//! designs of the renderer. Skipped where there is no GPU.

use crate::support::{golden, gpu};
use bevy_gs4d::renderer::Design;

/// On a software driver the largest differences are 1e-6 of color, 4e-6 of depth and 1e-6 of alpha, as on the CPU; and
/// 4e-4 of color over an environment map, whose texel depends on the driver's inverse trigonometric functions.
#[test]
fn gpu_matches_the_original() {
    let Some(mut headless) = gpu::headless() else { return };
    for (golden, (design, renderer)) in
        golden::all_views().iter().flat_map(|g| Design::NAMES[1..].iter().map(move |design| (g, *design)))
    {
        headless.set_design(renderer);
        let capture = headless.upload(&golden.scene).expect("upload");
        let frame = headless.render(&capture, &golden.view, golden.background).expect("render");
        let ([color, depth, alpha], ambiguous) = golden::differences(golden, &frame);
        println!(
            "{:32} {design:9} color {color:.1e} depth {depth:.1e} alpha {alpha:.1e} ambiguous {ambiguous:.1e}",
            golden.name
        );
        let allowed = if golden.scene.environment.is_some() { 1e-3 } else { 1e-5 };
        assert!(color <= allowed, "{}, {design}: color differs by {color}", golden.name);
        assert!(depth <= 4e-5, "{}, {design}: depth differs by {depth}", golden.name);
        assert!(alpha <= 1e-5, "{}, {design}: alpha differs by {alpha}", golden.name);
        assert!(ambiguous <= 1.0 / 255.0, "{}, {design}: ambiguous pixels differ by {ambiguous}", golden.name);
    }
}
