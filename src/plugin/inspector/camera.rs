//! The section "view": the settings with which one camera draws captures.
//!
//! In: a camera's [`CaptureViewSettings`], multisampling and tonemapping. Out: the edited values.

use super::listed::Listed;
use crate::plugin::render::CaptureViewSettings;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::render::view::Msaa;
use bevy_egui::egui;

/// Draws the settings for captures.
pub(super) fn show(ui: &mut egui::Ui, settings: CaptureViewSettings) -> CaptureViewSettings {
    let mut edited = settings;
    choice(ui, "debug view", &mut edited.debug);
    choice(ui, "blend space", &mut edited.blend_space);
    choice(ui, "written depth", &mut edited.depth);
    choice(ui, "renderer", &mut edited.design);
    edited
}

/// Draws the check box for multisampling.
pub(super) fn show_msaa(ui: &mut egui::Ui, msaa: Msaa) -> Msaa {
    let mut on = msaa != Msaa::Off;
    let touched = ui.checkbox(&mut on, "multisampling").changed();
    match (touched, on) {
        (false, _) => msaa,
        (true, false) => Msaa::Off,
        (true, true) => Msaa::Sample4,
    }
}

/// Draws the choice of tonemapping.
pub(super) fn show_tonemapping(ui: &mut egui::Ui, tonemapping: Tonemapping) -> Tonemapping {
    let mut edited = tonemapping;
    choice(ui, "tonemapping", &mut edited);
    edited
}

/// Draws a drop-down list of the values of an enum.
fn choice<T: Listed>(ui: &mut egui::Ui, label: &str, value: &mut T) {
    egui::ComboBox::from_label(label).selected_text(value.name()).show_ui(ui, |ui| {
        for &option in T::ALL {
            ui.selectable_value(value, option, option.name());
        }
    });
}
