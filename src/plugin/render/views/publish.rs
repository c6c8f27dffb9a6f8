//! Publish: copies the numbers of a frame from the render world to [`CaptureStatistics`].
//!
//! In: the prepared views and all uploaded captures. Out: updated [`CaptureStatistics`].

use super::capture_views::CaptureViews;
use crate::plugin::render::captures::upload::GpuGaussianCapture;
use crate::plugin::render::statistics::CaptureStatistics;
use crate::renderer::ViewStatistics;
use bevy::log::debug_span;
use bevy::render::render_asset::RenderAssets;
use std::borrow::Cow;

/// Copies the numbers of this frame to the main world.
pub(in crate::plugin::render) fn publish_statistics(
    statistics: &CaptureStatistics,
    views: &CaptureViews,
    captures: &RenderAssets<GpuGaussianCapture>,
) {
    let _span = debug_span!("gs4d/statistics").entered();
    // A view that no longer sees a capture may still hold memory.
    let shown = views.0.values().filter(|view| view.sees_something() || view.renderer.statistics().bytes > 0);
    let numbers = shown.map(|view| {
        let all = view.renderer.statistics();
        let numbers = match view.sees_something() {
            true => Cow::Borrowed(all),
            false => Cow::Owned(ViewStatistics {
                bytes: all.bytes,
                shared_bytes: all.shared_bytes,
                ..ViewStatistics::default()
            }),
        };
        (view.camera, numbers)
    });
    let uploaded = captures.iter().filter(|(_, capture)| capture.capture().is_some()).count();
    let bytes = captures.iter().map(|(_, capture)| capture.bytes()).sum();
    let uploading = captures.iter().filter(|(_, capture)| capture.bytes_left().is_some()).count();
    statistics.update(numbers, bytes, uploaded, uploading);
}
