//! Upload: from a loaded capture to its buffers on the GPU, once per asset (and again when it changes or the device was lost).
//!
//! In: [`GaussianCapture`]. Out: [`GpuGaussianCapture`] in `RenderAssets`; what could not be uploaded is told to the game.

use super::GaussianCapture3d;
use super::prepare::CaptureRenderer;
use super::statistics::CaptureStatistics;
use crate::asset::{Announcer, CaptureState, GaussianCapture};
use crate::gpu::GpuCapture;
use bevy::asset::{AssetId, AssetServer};
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, SystemParamItem, lifetimeless::SRes};
use bevy::log::{error, warn};
use bevy::render::render_asset::{PrepareAssetError, RenderAsset};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A capture on the GPU; empty where it could not be uploaded, which has been logged and told.
pub struct GpuGaussianCapture(Option<GpuCapture>);

impl GpuGaussianCapture {
    /// The buffers, if the capture can be drawn.
    pub fn capture(&self) -> Option<&GpuCapture> {
        self.0.as_ref()
    }
}

/// Captures that have been loaded but could not be uploaded. Both worlds share it.
#[derive(Resource, Debug, Clone, Default)]
pub struct UploadFailures(Arc<Mutex<HashMap<AssetId<GaussianCapture>, Failure>>>);

/// Why a capture could not be uploaded.
#[derive(Debug)]
struct Failure {
    error: String,
    /// Whether its entities have been told of this attempt.
    told: bool,
}

impl UploadFailures {
    /// Whether a capture is among them: its entities have then failed, although it has been loaded.
    pub(crate) fn contains(&self, capture: AssetId<GaussianCapture>) -> bool {
        self.lock().contains_key(&capture)
    }

    fn insert(&self, capture: AssetId<GaussianCapture>, error: String) {
        self.lock().insert(capture, Failure { error, told: false });
    }

    fn remove(&self, capture: AssetId<GaussianCapture>) {
        self.lock().remove(&capture);
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<AssetId<GaussianCapture>, Failure>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Tells every entity whose capture could not be uploaded, once for each attempt.
pub(super) fn report_upload_failures(
    failures: Res<UploadFailures>,
    mut captures: Query<(Entity, &GaussianCapture3d, &mut CaptureState)>,
    mut announcer: Announcer,
) {
    let mut failures = failures.lock();
    if failures.is_empty() {
        return;
    }
    for (entity, capture, mut state) in &mut captures {
        let Some(Failure { error, told }) = failures.get(&capture.0.id()) else { continue };
        if state.set_if_neq(CaptureState::Failed(error.clone())) || !told {
            announcer.failed(entity, error.clone());
        }
    }
    failures.values_mut().for_each(|failure| failure.told = true);
}

impl RenderAsset for GpuGaussianCapture {
    type SourceAsset = GaussianCapture;
    // No `byte_len`: under a limit of bytes for each frame Bevy takes the old upload away before it makes the new one.
    type Param = (
        SRes<RenderDevice>,
        SRes<RenderQueue>,
        SRes<AssetServer>,
        SRes<UploadFailures>,
        SRes<CaptureStatistics>,
        Option<SRes<CaptureRenderer>>,
    );

    fn prepare_asset(
        source: GaussianCapture,
        id: AssetId<GaussianCapture>,
        (device, queue, assets, failures, statistics, renderer): &mut SystemParamItem<Self::Param>,
        _previous: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<GaussianCapture>> {
        let name = || assets.get_path(id).map_or_else(|| format!("{id}"), |path| path.to_string());
        let Some(renderer) = renderer else {
            // It has been logged, once for all captures.
            let why = statistics.renderer_missing().unwrap_or_else(|| "there is no renderer".into());
            failures.insert(id, format!("{}: not drawn: {why}", name()));
            return Ok(Self(None));
        };
        if source.scene().trained_with.uses_fov_sentinel() {
            warn!(
                "{}: trained with the field-of-view sentinel of intrinsics cameras; drawn with each camera's true field of \
                 view, so it looks slightly different from its training",
                name()
            );
        }
        match GpuCapture::upload(device.wgpu_device(), queue, &renderer.0, source.scene()) {
            Ok(capture) => {
                failures.remove(id);
                Ok(Self(Some(capture)))
            }
            Err(failure) => {
                let failure = format!("{}: not drawn: {failure}", name());
                error!("{failure}");
                failures.insert(id, failure);
                Ok(Self(None))
            }
        }
    }

    fn unload_asset(id: AssetId<GaussianCapture>, (_, _, _, failures, ..): &mut SystemParamItem<Self::Param>) {
        failures.remove(id);
    }
}
