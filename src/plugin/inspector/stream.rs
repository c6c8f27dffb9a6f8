//! The section "stream": what is there of a capture in chunk files.
//!
//! In: the capture's [`CaptureStreamState`]. Out: lines of text.

use super::presentation;
use crate::plugin::stream::CaptureStreamState;
use bevy_egui::egui;

/// Draws the section.
pub(super) fn show(ui: &mut egui::Ui, state: &CaptureStreamState) {
    let late = state.needed.saturating_sub(state.resident);
    let here = format!("{} of {} files, {:.0} % of the Gaussians", state.resident, state.needed, 100.0 * state.share);
    ui.label(format!("of this time: {here}"));
    if late > 0 {
        let color = if state.is_coarse { ui.visuals().text_color() } else { ui.visuals().warn_fg_color };
        ui.colored_label(color, format!("late: {late} files"));
    }
    ui.label(format!("ahead: {:.1} s", state.buffered_seconds));
    let host = presentation::bytes(state.host_bytes);
    ui.label(format!("on their way: {} files, {host} in memory", state.requests));
    ui.label(format!("on the GPU: {}", presentation::bytes(state.gpu_bytes)));
    if state.failures > 0 {
        ui.label(format!("failed requests: {}", state.failures));
    }
}
