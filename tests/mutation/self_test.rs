//! Defects that the checks must find.
//!
//! In: readers and pictures with a known defect. Out: nothing; the program ends with a panic if a check does not find
//! the defect.

use crate::designs::{self, Expected};
use crate::limits::Limits;
use crate::readers::{Outcome, Reader};
use crate::rounding::Ranges;
use crate::support::packed_scene::{self, BLACK};
use crate::support::random::Random;
use crate::watch::{Seen, watch};
use bevy_gs4d::reference;
use glam::Vec3;
use std::sync::Arc;
use std::thread;

/// A reader with a helper thread that panics, whose result is ignored.
struct Swallows;

impl Reader for Swallows {
    fn input(&self, _: &mut Random) -> Vec<u8> {
        Vec::new()
    }

    fn read(&self, _: &[u8]) -> Result<Outcome, String> {
        let _ = thread::spawn(|| panic!("swallowed")).join();
        Ok(Outcome::Accepted)
    }
}

/// Checks that a panic in a helper thread, a picture beyond the limits of its scene, and a picture of another scene are
/// defects, and that the right picture is none.
pub fn run() {
    let Seen { outcome, .. } =
        watch("a panic in a helper thread", &(Arc::new(Swallows) as Arc<dyn Reader>), &Arc::from([]));
    let message = outcome.expect_err("a panic in a helper thread is a defect");
    assert!(message.contains("swallowed"), "the defect has the message of the panic: {message}");

    let scene = packed_scene::scene(200, 1, 0);
    let (limits, view) = (Limits::of(&scene), packed_scene::view(0.5));
    let frame = reference::render(&scene, &view, BLACK);
    limits.check(&frame, &view, BLACK).expect("the frame of the CPU reference is within the limits of the scene");
    let mut bright = frame.clone();
    bright.picture.pixels[7] = Vec3::splat(1e30);
    limits.check(&bright, &view, BLACK).expect_err("a color of 1e30 is a defect if no Gaussian is as bright");

    let expected = [Expected { view, background: BLACK, frame: frame.clone() }];
    designs::compare(&scene, &limits, &expected).expect("both designs draw the frame of the CPU reference");
    let mut half = scene.clone();
    let gaussians = &mut half.form.as_sliced_mut().expect("the scene is sliced").gaussians;
    gaussians.iter_mut().step_by(2).for_each(|gaussian| gaussian.opacity = 0.0);
    let other = reference::render(&half, &view, BLACK);
    let exact = || Ranges::exact(&frame, limits.brightest(BLACK));
    for ranges in [exact(), exact().rounded(&scene, &view, BLACK)] {
        designs::same(&frame, &ranges).expect("a frame lies in its own ranges");
        designs::same(&other, &ranges).expect_err("a frame without half of the Gaussians is a defect");
    }
    designs::reset_counts();
}
