//! The pictures of both GPU designs, compared with those of the CPU reference.
//!
//! In: a scene, views of it, and their frames by the CPU reference. Out: the first defect: a design that fails, a value
//! outside the limits of the scene, or a frame that differs from the other design or from the CPU reference; and the
//! counts of what was compared. Without a GPU nothing is compared, which is reported as skipped.

use crate::limits::Limits;
use crate::rounding::{Ranges, values_of};
use crate::support::gpu;
use crate::support::packed_scene::{self, BLACK};
use bevy_gs4d::offline::compress::compress;
use bevy_gs4d::renderer::{Design, GpuError, Headless};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Background, Frame, View};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Largest difference of a value, relative to the larger of 1 and the value: that of `tests/gpu/render.rs`.
const CLOSE: f32 = 1e-3;
/// Largest difference of the values of a few pixels, in which a splat is drawn by one side only, or two splats are
/// exchanged.
const FEW_CLOSE: f32 = 0.05;
/// One pixel of this many is one of the few, at least one of a picture.
const FEW: usize = 200;

/// A renderer of each design; `None` until [`open`] and without a GPU.
static RENDERERS: Mutex<Option<[Headless; 2]>> = Mutex::new(None);
/// The designs of the renderers.
const DESIGNS: [Design; 2] = [Design::GlobalSort, Design::TileBins];
static SCENES: AtomicUsize = AtomicUsize::new(0);
static PICTURES: AtomicUsize = AtomicUsize::new(0);
static SHOWING: AtomicUsize = AtomicUsize::new(0);
static ROUNDED: AtomicUsize = AtomicUsize::new(0);

/// A frame of the CPU reference, and what it shows.
pub struct Expected {
    pub view: View,
    pub background: Background,
    pub frame: Frame,
}

/// Opens the GPU and draws a scene of each form, so that no input waits for the compiler.
pub fn open() {
    let Some(first) = gpu::headless() else { return };
    let second = gpu::headless().expect("a GPU that opens a device opens another");
    let mut renderers = [first, second];
    let scene = packed_scene::scene(40, 1, 0);
    let packed = [&[][..], &[4, 4]].map(|codebooks| {
        let (packed, _) = compress(scene.clone(), &packed_scene::settings(codebooks)).expect("a synthetic scene");
        packed.into_runtime().expect("a synthetic scene can be drawn")
    });
    for (headless, design) in renderers.iter_mut().zip(DESIGNS) {
        headless.set_design(design);
        for scene in packed.iter().chain([&scene]) {
            let capture = headless.upload(scene).expect("a small scene fits");
            headless.render(&capture, &packed_scene::view(0.5), BLACK).expect("a small picture fits");
        }
    }
    *lock() = Some(renderers);
}

/// Sets the counts of what was compared to 0.
pub fn reset_counts() {
    for count in [&SCENES, &PICTURES, &SHOWING, &ROUNDED] {
        count.store(0, Ordering::Relaxed);
    }
}

/// Draws a scene with both designs and compares the frames with each other and with those of the CPU reference.
pub fn compare(scene: &RuntimeScene, limits: &Limits, expected: &[Expected]) -> Result<(), String> {
    let mut renderers = lock();
    let Some(renderers) = renderers.as_mut() else { return Ok(()) };
    let failed = |design, error: GpuError| format!("cannot be drawn by the design {design:?}: {error}");
    let mut frames = Vec::new();
    for (headless, design) in renderers.iter_mut().zip(DESIGNS) {
        let capture = headless.upload(scene).map_err(|error| failed(design, error))?;
        let draw = |Expected { view, background, .. }: &Expected| {
            let frame = headless.render(&capture, view, *background).map_err(|error| failed(design, error))?;
            limits.check(&frame, view, *background).map_err(|defect| format!("{defect}, by the design {design:?}"))?;
            Ok(frame)
        };
        frames.push(expected.iter().map(draw).collect::<Result<Vec<Frame>, String>>()?);
    }
    for ((expected, sorted), binned) in expected.iter().zip(&frames[0]).zip(&frames[1]) {
        let Expected { view, background, frame } = expected;
        let (time, brightest) = (view.time, limits.brightest(*background));
        let [a, b] = [sorted, binned].map(|frame| frame.counts.visible);
        if a != b {
            return Err(format!("is drawn with {a} splats by the global sort and {b} by tile bins at time {time}"));
        }
        same(binned, &Ranges::exact(sorted, brightest))
            .map_err(|worst| format!("is drawn differently by the designs at time {time}: {worst}"))?;
        let exact = Ranges::exact(frame, brightest);
        if same(sorted, &exact).is_err() {
            same(sorted, &exact.rounded(scene, view, *background))
                .map_err(|worst| format!("is drawn differently by the GPU and the CPU at time {time}: {worst}"))?;
            ROUNDED.fetch_add(1, Ordering::Relaxed);
        }
        PICTURES.fetch_add(1, Ordering::Relaxed);
        SHOWING.fetch_add(usize::from(a > 0), Ordering::Relaxed);
    }
    SCENES.fetch_add(1, Ordering::Relaxed);
    Ok(())
}

/// Returns the counts of what was compared, in words.
pub fn summary() -> String {
    let [scenes, pictures, showing, rounded] =
        [&SCENES, &PICTURES, &SHOWING, &ROUNDED].map(|count| count.load(Ordering::Relaxed));
    match lock().as_ref() {
        Some([headless, _]) => format!(
            "designs: {scenes} scenes drawn by both designs on {}, {pictures} pictures, {showing} with splats, \
             {rounded} that rounding changes",
            headless.context().info.name
        ),
        None => "designs: nothing drawn on a GPU; --draw draws accepted scenes, if there is one".to_owned(),
    }
}

fn lock() -> MutexGuard<'static, Option<[Headless; 2]>> {
    RENDERERS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Checks that a frame lies in the ranges, except for a few pixels. The error describes the worst pixel.
pub fn same(found: &Frame, expected: &Ranges) -> Result<(), String> {
    let apart: Vec<f32> = (0..expected.len()).map(|pixel| expected.distance(found, pixel)).collect();
    let beyond = apart.iter().filter(|apart| **apart > CLOSE).count();
    let worst = (0..apart.len()).max_by(|a, b| apart[*a].total_cmp(&apart[*b])).unwrap_or_default();
    if beyond <= (apart.len() / FEW).max(1) && apart.iter().all(|apart| *apart <= FEW_CLOSE) {
        return Ok(());
    }
    let width = found.picture.size.x;
    let (x, y) = (worst as u32 % width, worst as u32 / width);
    Err(format!(
        "{beyond} of {} pixels, ({x}, {y}) by {}: {:?} where {} is expected",
        apart.len(),
        apart[worst],
        values_of(found, worst),
        expected.described(worst)
    ))
}
