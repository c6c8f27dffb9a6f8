//! Upload: from a loaded capture to its buffers on the GPU, once per asset (and again when it changes or the device was lost).
//!
//! In: [`GaussianCapture`]. Out: [`GpuGaussianCapture`] in `RenderAssets`; what could not be uploaded is told to the game.

use super::GaussianCapture3d;
use super::prepare::CaptureRenderer;
use crate::asset::{CaptureFailed, CaptureState, GaussianCapture};
use crate::gpu::GpuCapture;
use bevy::asset::{AssetId, AssetServer};
use bevy::ecs::entity::Entity;
use bevy::ecs::message::MessageWriter;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Commands, Query, Res, SystemParamItem, lifetimeless::SRes};
use bevy::log::{error, warn};
use bevy::render::render_asset::{PrepareAssetError, RenderAsset};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::sync::{Arc, Mutex, PoisonError};

/// A capture on the GPU; empty where it could not be uploaded, which has been logged and told.
pub struct GpuGaussianCapture(Option<GpuCapture>);

impl GpuGaussianCapture {
    /// The buffers, if the capture can be drawn.
    pub fn capture(&self) -> Option<&GpuCapture> {
        self.0.as_ref()
    }
}

/// Uploads that failed, on their way to the main world. Both worlds share it.
#[derive(Resource, Debug, Clone, Default)]
pub struct UploadFailures(Arc<Mutex<Vec<(AssetId<GaussianCapture>, String)>>>);

impl UploadFailures {
    fn push(&self, capture: AssetId<GaussianCapture>, error: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push((capture, error));
    }

    fn take(&self) -> Vec<(AssetId<GaussianCapture>, String)> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Tells every entity whose capture could not be uploaded.
pub(super) fn report_upload_failures(
    failures: Res<UploadFailures>,
    mut captures: Query<(Entity, &GaussianCapture3d, &mut CaptureState)>,
    mut messages: MessageWriter<CaptureFailed>,
    mut commands: Commands,
) {
    for (failed, error) in failures.take() {
        for (entity, capture, mut state) in &mut captures {
            if capture.0.id() == failed {
                *state = CaptureState::Failed(error.clone());
                messages.write(CaptureFailed { entity, error: error.clone() });
                commands.trigger(CaptureFailed { entity, error: error.clone() });
            }
        }
    }
}

impl RenderAsset for GpuGaussianCapture {
    type SourceAsset = GaussianCapture;
    type Param =
        (SRes<RenderDevice>, SRes<RenderQueue>, SRes<AssetServer>, SRes<UploadFailures>, Option<SRes<CaptureRenderer>>);

    fn byte_len(source: &GaussianCapture) -> Option<usize> {
        let scene = source.scene();
        Some(scene.size())
    }

    fn prepare_asset(
        source: GaussianCapture,
        id: AssetId<GaussianCapture>,
        (device, queue, assets, failures, renderer): &mut SystemParamItem<Self::Param>,
        _previous: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<GaussianCapture>> {
        // Without a renderer there is nothing to upload for; why there is none has been logged.
        let Some(renderer) = renderer else { return Ok(Self(None)) };
        let name = || assets.get_path(id).map_or_else(|| format!("{id}"), |path| path.to_string());
        if source.scene().trained_with.uses_fov_sentinel() {
            warn!(
                "{}: trained with the field-of-view sentinel of intrinsics cameras; drawn with each camera's true field of \
                 view, so it looks slightly different from its training",
                name()
            );
        }
        match GpuCapture::upload(device.wgpu_device(), queue, &renderer.0, source.scene()) {
            Ok(capture) => Ok(Self(Some(capture))),
            Err(failure) => {
                error!("{}: not drawn: {failure}", name());
                failures.push(id, failure.to_string());
                Ok(Self(None))
            }
        }
    }
}
