//! Thinned captures on the CPU.
//!
//! In: the bundled captures. Out: proof that larger and more opaque Gaussians fill the gaps of those that are left out,
//! and that the picture changes little when the least importance does.

use crate::support::bundled::{BUNDLED, bundled, drawn, view_of};
use crate::support::psnr::psnr;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Thinning, View};
use glam::Vec3;

/// Returns a bundled capture, and a view of it.
fn viewed(name: &str, up: Vec3) -> (RuntimeScene, View) {
    let scene = bundled(name).into_runtime().expect("it can be drawn");
    let view = view_of(&scene, up);
    (scene, view)
}

/// Returns the importance that a share of the Gaussians exceed.
fn least_of(scene: &RuntimeScene, share: f32) -> f32 {
    let mut all: Vec<f32> = scene.iter().map(|gaussian| gaussian.importance()).collect();
    all.sort_unstable_by(|a, b| b.total_cmp(a));
    all[(share * all.len() as f32) as usize]
}

#[test]
fn larger_and_more_opaque_gaussians_fill_the_gaps() {
    for (name, up) in BUNDLED {
        let (scene, view) = viewed(name, up);
        let whole = drawn(&scene, view, Thinning::default());
        let mut before = f64::INFINITY;
        for share in [0.6, 0.4, 0.25] {
            let thinning = Thinning::new(least_of(&scene, share), share);
            let filled = psnr(&drawn(&scene, view, thinning), &whole);
            let bare = psnr(&drawn(&scene, view, Thinning { growth: 1.0, boost: 1.0, ..thinning }), &whole);
            println!("{name}, {share} of the Gaussians: {bare:.2} dB unchanged, {filled:.2} dB filled");
            assert!(filled > bare + 0.5, "{name}, {share}: {filled:.2} dB filled, {bare:.2} dB unchanged");
            assert!(filled > 17.0 && filled < before, "{name}, {share}: {filled:.2} dB, less than {before:.2}");
            before = filled;
        }
    }
}

#[test]
fn a_small_change_of_the_least_importance_changes_the_picture_little() {
    let (scene, view) = viewed("toybox.gs4d", Vec3::Z);
    let least = least_of(&scene, 0.5);
    let share = |least: f32| {
        let above = scene.iter().filter(|gaussian| gaussian.importance() > least).count();
        above as f32 / scene.len() as f32
    };
    let whole = drawn(&scene, view, Thinning::default());
    // The largest change in a frame.
    let next = least * 2f32.powf(1.0 / 16.0);
    let [a, b] = [least, next].map(|least| drawn(&scene, view, Thinning::new(least, share(least))));
    let fall = psnr(&a, &whole) - psnr(&b, &whole);
    let apart = psnr(&a, &b);
    println!("{fall:.3} dB in a step; two frames differ by {apart:.2} dB");
    assert!(fall > 0.0 && fall < 1.0, "the picture falls by {fall} dB in a step");
    assert!(apart > 35.0, "two frames are {apart} dB apart");
}
