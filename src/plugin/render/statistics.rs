//! Statistics: what drawing captures costs, for panels and tests.
//!
//! In: what the render world counts and measures. Out: [`CaptureStatistics`], a resource of the main world that shares it.

use super::prepare::CaptureViews;
use super::upload::GpuGaussianCapture;
use crate::renderer::{GpuCapture, ViewStatistics};
use bevy::ecs::entity::Entity;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::Res;
use bevy::log::debug_span;
use bevy::render::render_asset::RenderAssets;
use std::borrow::Cow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What drawing captures costs, as of the newest frame that the render world has prepared.
#[derive(Resource, Debug, Clone, Default)]
pub struct CaptureStatistics(Arc<Mutex<Shared>>);

#[derive(Debug, Default)]
struct Shared {
    measure: bool,
    views: Vec<(Entity, ViewStatistics)>,
    capture_bytes: u64,
    uploaded_captures: usize,
    renderer_missing: Option<String>,
}

impl CaptureStatistics {
    /// Asks for the GPU time of each pass, or no longer for it. The first times arrive some frames later; where the GPU has no
    /// timestamps there are none.
    pub fn measure(&self, on: bool) {
        self.lock().measure = on;
    }

    /// Of one camera, by its entity in the main world; nothing while it sees no capture.
    pub fn view(&self, camera: Entity) -> Option<ViewStatistics> {
        self.lock().views.iter().find(|(entity, _)| *entity == camera).map(|(_, statistics)| statistics.clone())
    }

    /// Of every camera that sees a capture.
    pub fn views(&self) -> Vec<(Entity, ViewStatistics)> {
        self.lock().views.clone()
    }

    /// GPU memory of all uploaded captures, bytes. What views need on top is in [`ViewStatistics::bytes`].
    pub fn capture_bytes(&self) -> u64 {
        self.lock().capture_bytes
    }

    /// How many captures are on the GPU.
    pub fn uploaded_captures(&self) -> usize {
        self.lock().uploaded_captures
    }

    /// Why no capture is drawn at all: what this GPU lacks. Nothing where captures can be drawn.
    pub fn renderer_missing(&self) -> Option<String> {
        self.lock().renderer_missing.clone()
    }

    pub(super) fn set_renderer_missing(&self, why: Option<String>) {
        self.lock().renderer_missing = why;
    }

    pub(super) fn is_measuring(&self) -> bool {
        self.lock().measure
    }

    /// What a panic elsewhere left behind is still only numbers.
    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Hands the numbers of a frame over.
pub(super) fn publish_statistics(
    statistics: Res<CaptureStatistics>,
    views: Res<CaptureViews>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
) {
    let _span = debug_span!("gs4d/statistics").entered();
    let mut shared = statistics.lock();
    // A view that sees nothing any more may still hold memory.
    let seen = || views.0.values().filter(|view| view.sees_something() || view.renderer.statistics().bytes > 0);
    shared.views.retain(|(camera, _)| seen().any(|view| view.camera == *camera));
    for view in seen() {
        let all = view.renderer.statistics();
        let fresh = match view.sees_something() {
            true => Cow::Borrowed(all),
            false => Cow::Owned(ViewStatistics { bytes: all.bytes, ..ViewStatistics::default() }),
        };
        match shared.views.iter_mut().find(|(camera, _)| *camera == view.camera) {
            Some((_, known)) if known == fresh.as_ref() => {}
            Some((_, known)) => *known = fresh.into_owned(),
            None => shared.views.push((view.camera, fresh.into_owned())),
        }
    }
    let uploaded = || captures.iter().filter_map(|(_, capture)| capture.capture());
    shared.capture_bytes = uploaded().map(GpuCapture::bytes).sum();
    shared.uploaded_captures = uploaded().count();
}
