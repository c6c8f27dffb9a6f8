//! The section "counts": the Gaussians and pairs that a view draws.
//!
//! In: the statistics of a view, the time between frames. Out: bars.

use super::presentation::{count, fraction, frame_rate};
use crate::renderer::ViewStatistics;
use bevy_egui::egui;

/// Draws the section. `view` has the statistics of the shown camera, `None` before it has drawn a capture;
/// `frame_seconds` is the mean time of a frame.
pub(super) fn show(ui: &mut egui::Ui, view: Option<&ViewStatistics>, frame_seconds: f32) {
    ui.label(frame_rate(frame_seconds));
    let Some(view) = view else {
        ui.weak("this view has drawn nothing yet");
        return;
    };
    for (name, part) in [("total", view.total), ("active", view.active), ("visible", view.visible)] {
        let fraction = fraction(part.into(), view.total.into());
        bar(ui, fraction, format!("{name}: {} ({:.0} %)", count(part.into()), fraction * 100.0));
    }
    let each = if view.visible > 0 { f64::from(view.pairs) / f64::from(view.visible) } else { 0.0 };
    ui.label(format!("pairs: {}, {each:.1} per visible Gaussian", count(view.pairs.into())))
        .on_hover_text("a pair is one Gaussian in one tile of the picture");
}

/// Draws a bar with a text on it. `fraction` is the filled part, from 0 to 1.
pub(super) fn bar(ui: &mut egui::Ui, fraction: f32, text: String) {
    ui.add(egui::ProgressBar::new(fraction).corner_radius(2.0).text(text));
}
