//! View: how one camera draws captures.
//!
//! In: a camera's [`CaptureViewSettings`], multisampling and tonemapping. Out: these as somebody wants them.

use crate::plugin::render::{CaptureViewSettings, DepthWrite};
use crate::view::{BlendSpace, DebugView};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::render::view::Msaa;
use bevy_egui::egui;

const DEBUG_VIEWS: [(DebugView, &str); 6] = [
    (DebugView::Color, "colour"),
    (DebugView::Depth, "depth"),
    (DebugView::Overdraw, "overdraw"),
    (DebugView::Active, "active"),
    (DebugView::Lifespan, "lifespan (Σ_t)"),
    (DebugView::Velocity, "velocity"),
];

const BLEND_SPACES: [(BlendSpace, &str); 2] =
    [(BlendSpace::Encoded, "encoded, as trained"), (BlendSpace::Linear, "linear light")];

const DEPTHS: [(DepthWrite, &str); 3] =
    [(DepthWrite::None, "none"), (DepthWrite::Expected, "expected"), (DepthWrite::Median, "median")];

const TONEMAPPERS: [(Tonemapping, &str); 9] = [
    (Tonemapping::None, "none, as trained"),
    (Tonemapping::Reinhard, "Reinhard"),
    (Tonemapping::ReinhardLuminance, "Reinhard luminance"),
    (Tonemapping::AcesFitted, "ACES fitted"),
    (Tonemapping::AgX, "AgX"),
    (Tonemapping::SomewhatBoringDisplayTransform, "somewhat boring"),
    (Tonemapping::TonyMcMapface, "Tony McMapface"),
    (Tonemapping::BlenderFilmic, "Blender filmic"),
    (Tonemapping::KhronosPbrNeutral, "Khronos PBR neutral"),
];

/// Draws what is set for captures.
pub(super) fn show(ui: &mut egui::Ui, settings: CaptureViewSettings) -> CaptureViewSettings {
    let mut edited = settings;
    choice(ui, "debug view", &mut edited.debug, &DEBUG_VIEWS);
    choice(ui, "blend space", &mut edited.blend_space, &BLEND_SPACES);
    choice(ui, "written depth", &mut edited.depth, &DEPTHS);
    edited
}

/// Draws whether meshes are multisampled.
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
    choice(ui, "tonemapping", &mut edited, &TONEMAPPERS);
    edited
}

/// A list of which one is chosen.
fn choice<T: PartialEq + Copy>(ui: &mut egui::Ui, label: &str, value: &mut T, options: &[(T, &str)]) {
    let name = options.iter().find(|(option, _)| *option == *value).map_or("", |(_, name)| *name);
    egui::ComboBox::from_label(label).selected_text(name).show_ui(ui, |ui| {
        for &(option, name) in options {
            ui.selectable_value(value, option, name);
        }
    });
}
