//! Statistics: counts, times and memory of drawing captures, for panels and tests.
//!
//! In: the counts and times of the render world. Out: [`CaptureStatistics`], a resource that both worlds share.

use crate::renderer::{Measured, ViewStatistics, WorkCounters};
use bevy::ecs::entity::Entity;
use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use std::borrow::Cow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Counts, GPU times and memory of drawing captures in the newest frame that the render world has prepared: a resource.
///
/// Clones share the numbers. Default: no views, no captures, no measurement.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn report(statistics: Res<CaptureStatistics>) {
///     for (camera, view) in statistics.views() {
///         info!("{camera}: {} of {} Gaussians are visible", view.visible, view.total);
///     }
///     info!("{} bytes for {} captures", statistics.capture_bytes(), statistics.uploaded_captures());
/// }
/// # bevy::ecs::system::assert_is_system(report);
/// ```
#[derive(Resource, Reflect, Debug, Clone, Default)]
#[reflect(opaque)]
#[reflect(Resource, Default, Debug, Clone)]
#[type_path = "bevy_gs4d::render"]
pub struct CaptureStatistics(Arc<Mutex<Shared>>);

#[derive(Debug, Default)]
struct Shared {
    measure: bool,
    measure_for_panel: bool,
    measure_for_budget: bool,
    views: Vec<(Entity, ViewStatistics)>,
    capture_bytes: u64,
    uploaded_captures: usize,
    uploading_captures: usize,
    /// In pixels.
    cut: f32,
    renderer_missing: Option<String>,
    /// Kept when the renderer is created again after a lost device.
    work: WorkCounters,
}

impl CaptureStatistics {
    /// Starts or stops measuring the GPU time of each pass. The first times arrive some frames later; on a GPU without
    /// timestamps no times arrive. The inspector also measures while it shows these times. A
    /// [`CaptureBudget`](super::CaptureBudget) of GPU time measures frames as a whole. Default: not measured.
    pub fn measure(&self, on: bool) {
        self.lock().measure = on;
    }

    /// Starts or stops measuring for the inspector, independently of [`measure`](Self::measure).
    #[cfg(feature = "inspector")]
    pub(crate) fn measure_for_panel(&self, on: bool) {
        self.lock().measure_for_panel = on;
    }

    /// Starts or stops measuring for a [`CaptureBudget`](super::CaptureBudget).
    pub(super) fn measure_for_budget(&self, on: bool) {
        self.lock().measure_for_budget = on;
    }

    /// Returns the size on the screen up to which Gaussians are left out to keep a
    /// [`CaptureBudget`](super::CaptureBudget), in pixels: [importance](crate::gaussian::Gaussian::importance), which is
    /// opacity squared times extent, at a typical depth of each capture. 0 while all Gaussians are drawn.
    pub fn cut(&self) -> f32 {
        self.lock().cut
    }

    pub(super) fn set_cut(&self, pixels: f32) {
        self.lock().cut = pixels;
    }

    /// Returns the GPU time of captures in the newest measured frame, summed over all cameras, in seconds; 0 if it has
    /// not been measured.
    pub fn gpu_seconds(&self) -> f32 {
        // The sum of nothing is −0.
        let milliseconds =
            self.lock().views.iter().flat_map(|(_, view)| &view.passes).fold(0.0, |sum, pass| sum + pass.milliseconds);
        (milliseconds * 1e-3) as f32
    }

    /// Returns the statistics of one camera, by its entity in the main world; `None` while it sees no capture and holds
    /// no memory for captures.
    pub fn view(&self, camera: Entity) -> Option<ViewStatistics> {
        self.lock().views.iter().find(|(entity, _)| *entity == camera).map(|(_, statistics)| statistics.clone())
    }

    /// Returns the statistics of every camera that sees a capture or holds memory for captures, by main-world entity.
    pub fn views(&self) -> Vec<(Entity, ViewStatistics)> {
        self.lock().views.clone()
    }

    /// Returns the GPU memory of all uploaded captures, in bytes. The memory of views is in [`ViewStatistics::bytes`].
    pub fn capture_bytes(&self) -> u64 {
        self.lock().capture_bytes
    }

    /// Returns the number of captures on the GPU.
    pub fn uploaded_captures(&self) -> usize {
        self.lock().uploaded_captures
    }

    /// Returns the number of captures that are being uploaded, including those of which an older version is drawn.
    pub fn uploading_captures(&self) -> usize {
        self.lock().uploading_captures
    }

    /// Returns the counters of objects created, bytes uploaded and work recorded on the GPU, shared by clones.
    pub fn work(&self) -> WorkCounters {
        self.lock().work.clone()
    }

    /// Returns the reason why no capture can be drawn on this GPU or in this app; `None` if captures can be drawn.
    pub fn renderer_missing(&self) -> Option<String> {
        self.lock().renderer_missing.clone()
    }

    pub(super) fn set_renderer_missing(&self, why: Option<String>) {
        self.lock().renderer_missing = why;
    }

    /// Returns how GPU time is measured.
    pub(crate) fn measured(&self) -> Measured {
        let shared = self.lock();
        if shared.measure || shared.measure_for_panel {
            Measured::Passes
        } else if shared.measure_for_budget {
            Measured::Frame
        } else {
            Measured::Nothing
        }
    }

    /// Replaces the numbers by those of a new frame: the statistics of each camera that sees captures or holds memory
    /// for them, the bytes and count of all uploaded captures, and the count of captures being uploaded.
    pub(super) fn update<'a>(
        &self,
        views: impl Iterator<Item = (Entity, Cow<'a, ViewStatistics>)> + Clone,
        capture_bytes: u64,
        uploaded_captures: usize,
        uploading_captures: usize,
    ) {
        let mut shared = self.lock();
        shared.views.retain(|(camera, _)| views.clone().any(|(shown, _)| shown == *camera));
        for (camera, numbers) in views {
            match shared.views.iter_mut().find(|(known, _)| *known == camera) {
                Some((_, known)) if *known == *numbers => {}
                Some((_, known)) => *known = numbers.into_owned(),
                None => shared.views.push((camera, numbers.into_owned())),
            }
        }
        shared.capture_bytes = capture_bytes;
        shared.uploaded_captures = uploaded_captures;
        shared.uploading_captures = uploading_captures;
    }

    /// Locks the numbers. After a panic of another holder they are outdated but valid.
    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
