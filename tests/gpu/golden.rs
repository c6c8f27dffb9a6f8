//! The renderer against the original implementation, on all golden views.
//!
//! In: the scenes of `tests/golden/`. Out: proof that the GPU's pictures are those of the original, with
//! both designs of the renderer. Skipped where there is no GPU.

use crate::support::{golden, gpu};
use bevy_gs4d::renderer::Design;

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
            "{:32} {design:9} colour {color:.1e} depth {depth:.1e} alpha {alpha:.1e} ambiguous {ambiguous:.1e}",
            golden.name
        );
        assert!(color <= 1e-3, "{}, {design}: colour differs by {color}", golden.name);
        assert!(depth <= 5e-3, "{}, {design}: depth differs by {depth}", golden.name);
        assert!(alpha <= 1e-3, "{}, {design}: alpha differs by {alpha}", golden.name);
        assert!(ambiguous <= 2.0 / 255.0, "{}, {design}: ambiguous pixels differ by {ambiguous}", golden.name);
    }
}
