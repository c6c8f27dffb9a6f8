//! The section "memory": the bytes of captures and of a view on the GPU.
//!
//! In: [`CaptureStatistics`] and the statistics of a view. Out: lines of text.

use super::presentation;
use crate::plugin::render::CaptureStatistics;
use crate::renderer::ViewStatistics;
use bevy_egui::egui;

/// Draws the section. `view` has the statistics of the shown camera, `None` before it has drawn a capture.
pub(super) fn show(ui: &mut egui::Ui, statistics: &CaptureStatistics, view: Option<&ViewStatistics>) {
    let (captures, scenes) = (statistics.uploaded_captures(), statistics.capture_bytes());
    ui.label(format!("captures: {} in {captures}", presentation::bytes(scenes)));
    let working = view.map_or(0, |view| view.bytes);
    ui.label(format!("working memory of this view: {}", presentation::bytes(working)));
    let shared = view.map_or(0, |view| view.shared_bytes);
    ui.label(format!("working memory of all views: {}", presentation::bytes(shared)));
}
