//! Accepted scenes drawn on the GPU, by both designs.
//!
//! In: a scene, a view, its frame by the CPU reference. Out: nothing, or the defect: a design that draws another picture or does not draw.
//! Where there is no GPU, the comparison is skipped, and the program says so.

use bevy_gs4d::reference;
use bevy_gs4d::renderer::{Design, GpuContext, Headless, ShaderChecks};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Background, Frame, View};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Least PSNR to the CPU reference, dB, relative to the brightest value of the picture, and for transmittances. A splat whose alpha
/// rounds to the other side of 1/255 changes a pixel by 0.004.
const LEAST_PSNR: f64 = 45.0;

/// The renderers of both designs; `None` without a GPU.
static RENDERERS: OnceLock<Option<Mutex<[Headless; 2]>>> = OnceLock::new();

fn renderers() -> Option<&'static Mutex<[Headless; 2]>> {
    let open = |design| {
        let context = GpuContext::headless(None).ok()?;
        let mut headless = Headless::new(context, ShaderChecks::On).expect("the passes compile");
        headless.set_design(design);
        Some(headless)
    };
    let both = || Some(Mutex::new([open(Design::Reference)?, open(Design::Fast)?]));
    RENDERERS.get_or_init(both).as_ref()
}

/// Opens the GPU, so that the time that this takes is not counted for an input. Prints the reason if nothing is drawn on it.
pub fn open() {
    if renderers().is_none() {
        println!("skipped: mutation: no GPU, accepted scenes are drawn by the CPU reference alone");
    }
}

/// Draws a view by both designs and by the CPU reference.
///
/// # Errors
/// The design that draws another picture, or none.
pub fn compare(scene: &RuntimeScene, view: &View, background: Background) -> Result<(), String> {
    let Some(renderers) = renderers() else { return Ok(()) };
    let expected = reference::render(scene, view, background);
    for headless in renderers.lock().unwrap_or_else(PoisonError::into_inner).iter_mut() {
        let design = headless.design();
        let capture = headless.upload(scene).map_err(|error| format!("is not uploaded for {design:?}: {error}"))?;
        let found = headless
            .render(&capture, view, background)
            .map_err(|error| format!("is not drawn by {design:?}: {error}"))?;
        let values = |frame: &Frame| -> Vec<f32> { frame.picture.pixels.iter().flat_map(|p| p.to_array()).collect() };
        let (color, wanted) = (values(&found), values(&expected));
        let peak = wanted.iter().fold(1.0f32, |peak, value| peak.max(value.abs()));
        for (name, found, wanted, peak) in
            [("color", &color, &wanted, peak), ("transmittance", &found.transmittance, &expected.transmittance, 1.0)]
        {
            let psnr = psnr(found, wanted, peak);
            // The negated comparison is true for NaN.
            if !(psnr >= LEAST_PSNR) {
                return Err(format!(
                    "has a {name} by {design:?} at {psnr:.1} dB to the CPU reference, peak {peak:e}, at time {}",
                    view.time
                ));
            }
        }
    }
    Ok(())
}

fn psnr(found: &[f32], wanted: &[f32], peak: f32) -> f64 {
    let square = |(a, b): (&f32, &f32)| ((f64::from(*a) - f64::from(*b)) / f64::from(peak)).powi(2);
    let sum: f64 = found.iter().zip(wanted).map(square).sum();
    -10.0 * (sum / wanted.len().max(1) as f64).max(1e-20).log10()
}
