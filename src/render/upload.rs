//! Upload: from a loaded capture to its buffers on the GPU, once per asset (and again when it changes or the device was lost).
//!
//! In: [`GaussianCapture`]. Out: [`GpuGaussianCapture`] in `RenderAssets`.

use super::prepare::CaptureRenderer;
use crate::asset::GaussianCapture;
use crate::gpu::GpuCapture;
use bevy::asset::{AssetId, AssetServer};
use bevy::ecs::system::{SystemParamItem, lifetimeless::SRes};
use bevy::log::{error, warn};
use bevy::render::render_asset::{PrepareAssetError, RenderAsset};
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// A capture on the GPU; empty where it could not be uploaded, which has been logged.
pub struct GpuGaussianCapture(Option<GpuCapture>);

impl GpuGaussianCapture {
    /// The buffers, if the capture can be drawn.
    pub fn capture(&self) -> Option<&GpuCapture> {
        self.0.as_ref()
    }
}

impl RenderAsset for GpuGaussianCapture {
    type SourceAsset = GaussianCapture;
    type Param = (SRes<RenderDevice>, SRes<RenderQueue>, SRes<AssetServer>, Option<SRes<CaptureRenderer>>);

    fn byte_len(source: &GaussianCapture) -> Option<usize> {
        let scene = source.scene();
        Some(scene.size())
    }

    fn prepare_asset(
        source: GaussianCapture,
        id: AssetId<GaussianCapture>,
        (device, queue, assets, renderer): &mut SystemParamItem<Self::Param>,
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
                Ok(Self(None))
            }
        }
    }
}
