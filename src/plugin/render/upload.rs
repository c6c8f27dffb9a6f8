//! Upload: from a loaded capture to its buffers on the GPU, once per asset (and again when it changes or the device was lost).
//!
//! In: [`GaussianCapture`]. Out: [`GpuGaussianCapture`] in `RenderAssets`, or an entry in [`UploadFailures`], which becomes a message.

use super::renderer::CaptureRenderer;
use super::statistics::CaptureStatistics;
use crate::plugin::asset::UploadFailures;
use crate::plugin::component::GaussianCapture;
use crate::renderer::GpuCapture;
use bevy::asset::{AssetId, AssetServer};
use bevy::ecs::system::SystemParamItem;
use bevy::ecs::system::lifetimeless::SRes;
use bevy::log::{error, warn};
use bevy::render::render_asset::{PrepareAssetError, RenderAsset};
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// A capture on the GPU; empty if it could not be uploaded, which has then been logged and reported.
pub struct GpuGaussianCapture(Option<GpuCapture>);

impl GpuGaussianCapture {
    /// Returns the buffers; `None` if the capture cannot be drawn.
    pub fn capture(&self) -> Option<&GpuCapture> {
        self.0.as_ref()
    }
}

impl RenderAsset for GpuGaussianCapture {
    type SourceAsset = GaussianCapture;
    // No `byte_len`: with a limit of bytes for each frame, Bevy removes the old upload before it prepares the new one.
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
