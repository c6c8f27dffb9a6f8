//! Images that say what they cover.
//!
//! In: a scene and a training view. Out: the image of the view, drawn by the CPU reference over nothing, with its coverage as alpha.

use bevy_gs4d::offline::dataset::TrainingView;
use bevy_gs4d::reference;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Background, RasterFov};
use std::path::Path;

/// Writes the image of a view with its coverage, as a camera of this gain takes it.
pub fn write_covered(scene: &RuntimeScene, view: &TrainingView, gain: f32, path: &Path) {
    let to_draw = view.camera.view(view.time, RasterFov::Corrected);
    let frame = reference::render(scene, &to_draw, Background::None);
    let mut image = image::RgbaImage::new(view.camera.size.x, view.camera.size.y);
    let pixels = image.pixels_mut().zip(frame.picture.pixels.iter().zip(&frame.transmittance));
    for (pixel, (color, transmittance)) in pixels {
        let coverage = 1.0 - transmittance;
        let [r, g, b] = (*color * gain / coverage.max(1e-3)).to_array();
        pixel.0 = [r, g, b, coverage].map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8);
    }
    image.save(path).expect("the folder can be written to");
}
