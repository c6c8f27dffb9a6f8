//! The section "appearance": the settings with which one capture is drawn.
//!
//! In: the capture's [`CaptureSettings`] and bounds. Out: the edited settings.

use crate::plugin::render::{CaptureSettings, CropBox};
use crate::scene::{Bounds, MAX_LEVELS};
use bevy::color::LinearRgba;
use bevy_egui::egui;
use egui::{DragValue, Slider, SliderClamping};
use glam::{Quat, Vec3};

/// Draws the section. `bounds`, in capture space, gives the size of a new crop box.
pub(super) fn show(ui: &mut egui::Ui, settings: CaptureSettings, bounds: Option<Bounds>) -> CaptureSettings {
    let mut edited = settings;
    ui.checkbox(&mut edited.filter, "temporal filter");
    let opacity = Slider::new(&mut edited.opacity, 0.0..=1.0).clamping(SliderClamping::Edits);
    ui.add(opacity.max_decimals(2).text("opacity"));
    let exposure = Slider::new(&mut edited.exposure, -5.0..=5.0).clamping(SliderClamping::Edits);
    ui.add(exposure.max_decimals(2).suffix(" stops").text("exposure"));
    ui.horizontal(|ui| {
        let mut rgb = [edited.tint.red, edited.tint.green, edited.tint.blue];
        // The color picker also rounds colors that are not edited.
        if ui.color_edit_button_rgb(&mut rgb).changed() {
            let [red, green, blue] = rgb;
            edited.tint = LinearRgba { red, green, blue, ..edited.tint };
        }
        ui.label("tint");
        if ui.button("as trained").clicked() {
            let CaptureSettings { opacity, tint, exposure, .. } = CaptureSettings::default();
            edited = CaptureSettings { opacity, tint, exposure, ..edited };
        }
    });
    ui.checkbox(&mut edited.antialias, "anti-aliased");
    let levels = Slider::new(&mut edited.finest_level, 0..=MAX_LEVELS as u8).clamping(SliderClamping::Edits);
    ui.add(levels.text("finest level"));
    let priority = Slider::new(&mut edited.priority, 0.1..=10.0).logarithmic(true).clamping(SliderClamping::Edits);
    ui.add(priority.text("priority in the budget"));
    let mut cropped = edited.crop.is_some();
    if ui.checkbox(&mut cropped, "crop box").changed() {
        edited.crop = cropped.then(|| crop_around(bounds));
    }
    if let Some(crop) = &mut edited.crop {
        axes(ui, "center", &mut crop.center, f32::NEG_INFINITY);
        axes(ui, "half size", &mut crop.half_size, 0.0);
    }
    edited
}

/// Returns the box that encloses the whole capture.
fn crop_around(bounds: Option<Bounds>) -> CropBox {
    let (center, half_size) = bounds.map_or((Vec3::ZERO, Vec3::ONE), |b| (b.center(), (b.max - b.min) * 0.5));
    CropBox { center, half_size, rotation: Quat::IDENTITY }
}

/// Draws three drag values with the lower limit `least`.
fn axes(ui: &mut egui::Ui, name: &str, vector: &mut Vec3, least: f32) {
    ui.horizontal(|ui| {
        for value in [&mut vector.x, &mut vector.y, &mut vector.z] {
            let axis = DragValue::new(value).speed(0.01).max_decimals(3).range(least..=f32::INFINITY);
            ui.add(axis.clamp_existing_to_range(false));
        }
        ui.label(name);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawing_the_section_changes_no_setting() {
        let crop = CropBox { center: Vec3::splat(0.123_45), half_size: Vec3::splat(-1.0), rotation: Quat::IDENTITY };
        let odd = CaptureSettings {
            filter: false,
            opacity: 7.123_4,
            tint: LinearRgba::new(0.123_45, 3.0, -1.0, 0.5),
            exposure: -20.123_4,
            crop: Some(crop),
            finest_level: 3,
            priority: 0.012_3,
            antialias: false,
        };
        let context = egui::Context::default();
        for settings in [CaptureSettings::default(), odd] {
            for _ in 0..3 {
                let mut edited = settings;
                let output = context.run_ui(egui::RawInput::default(), |ui| edited = show(ui, edited, None));
                output.drop_without_applying_deltas();
                assert_eq!(edited, settings, "drawing the section changes no setting");
            }
        }
    }

    #[test]
    fn a_new_crop_box_encloses_the_whole_capture() {
        let crop = crop_around(Some(Bounds { min: Vec3::new(-1.0, 0.0, 2.0), max: Vec3::new(3.0, 1.0, 4.0) }));
        assert_eq!(
            crop.center - crop.half_size,
            Vec3::new(-1.0, 0.0, 2.0),
            "the smallest corner of the crop box is that of the bounds"
        );
        assert_eq!(
            crop.center + crop.half_size,
            Vec3::new(3.0, 1.0, 4.0),
            "the largest corner of the crop box is that of the bounds"
        );
    }
}
