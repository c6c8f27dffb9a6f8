//! Active lists: the Gaussians active in the current segment of a temporal filter, one list per placed capture.
//!
//! In: [`ExtractedCaptures`]. Out: [`ActiveLists`], shared by all cameras. A list is written on the GPU before any
//! camera draws, and only when its capture has entered another segment.

use super::back_off::BackOff;
use super::detail::CaptureLevels;
use super::extract::ExtractedCaptures;
use super::upload::GpuGaussianCapture;
use crate::plugin::component::GaussianCapture;
use crate::plugin::render::logged::error_once_each;
use crate::plugin::render::renderer::CaptureRenderer;
use crate::renderer::ActiveList;
use crate::renderer::device::memory::catch_known;
use bevy::asset::AssetId;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Res, ResMut};
use bevy::log::debug_span;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::sync_world::{MainEntity, MainEntityHashMap};

/// The lists of captures with a temporal filter, by entity of the main world, kept while the asset is the same.
#[derive(Resource, Default)]
pub(crate) struct ActiveLists {
    pub(in crate::plugin::render) placed: MainEntityHashMap<PlacedList>,
    /// Captures for whose list there was no memory. Until the retry, all of their Gaussians are drawn, or none of a capture
    /// in chunk files.
    back_off: BackOff<MainEntity>,
}

/// The list of one entity.
pub(in crate::plugin::render) struct PlacedList {
    pub(in crate::plugin::render) list: ActiveList,
    asset: AssetId<GaussianCapture>,
    /// Whether the list must be rewritten for another segment.
    stale: bool,
}

/// Creates the lists of new captures, drops those of removed captures, and moves the others to the current segment.
pub(in crate::plugin::render) fn prepare_active_lists(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    renderer: Option<Res<CaptureRenderer>>,
    extracted: Res<ExtractedCaptures>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    levels: Res<CaptureLevels>,
    mut lists: ResMut<ActiveLists>,
) {
    let _span = debug_span!("gs4d/lists").entered();
    let Some(renderer) = renderer else { return };
    lists.back_off.count_frame();
    lists.placed.retain(|entity, placed| {
        let shown = extracted.0.get(entity).filter(|shown| shown.asset == placed.asset && !shown.is_blank);
        let uploaded = shown.and_then(|shown| Some((shown, captures.get(shown.asset)?.capture()?)));
        uploaded.is_some_and(|(shown, capture)| shown.is_listed(capture) && placed.list.is_for(capture))
    });
    for (entity, shown) in &extracted.0 {
        // Levels of detail have no filter. Lights draw all Gaussians, whatever level cameras draw.
        let is_coarse = levels.is_coarse(entity) && !shown.casts;
        if !shown.seen || shown.is_faded_out() || shown.is_blank || is_coarse {
            continue;
        }
        let Some(uploaded) = captures.get(shown.asset) else { continue };
        let (Some(capture), Some(time)) = (uploaded.capture(), uploaded.time_at(shown.seconds)) else { continue };
        if !shown.is_listed(capture) {
            continue;
        }
        if !lists.placed.contains_key(entity) {
            if lists.back_off.contains(entity) {
                continue;
            }
            let device = device.wgpu_device();
            let created = catch_known(device, capture.bytes(), || ActiveList::new(device, &renderer.0, capture));
            let list = match created {
                Ok(Some(list)) => list,
                Ok(None) => continue,
                Err(failure) => {
                    error_once_each(&format!("the temporal filter of capture {} is not used: {failure}", entity.id()));
                    lists.back_off.begin(*entity);
                    continue;
                }
            };
            lists.placed.insert(*entity, PlacedList { list, asset: shown.asset, stale: false });
        }
        if let Some(placed) = lists.placed.get_mut(entity) {
            placed.stale = placed.list.prepare(&queue, capture, time);
        }
    }
}

/// Returns whether any list must be written.
pub(in crate::plugin::render) fn any_stale(lists: Res<ActiveLists>) -> bool {
    lists.placed.values().any(|placed| placed.stale)
}

/// Records `activate` for the stale lists, before the cameras.
pub(in crate::plugin::render) fn record_active_lists(
    renderer: Option<Res<CaptureRenderer>>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    mut lists: ResMut<ActiveLists>,
    mut context: RenderContext,
) {
    let _span = debug_span!("gs4d/activate").entered();
    let Some(renderer) = renderer else { return };
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "gs4d/activate");
    for placed in lists.placed.values_mut().filter(|placed| placed.stale) {
        if let Some(capture) = captures.get(placed.asset).and_then(|uploaded| uploaded.capture()) {
            placed.list.record(&renderer.0, context.command_encoder(), capture);
            placed.stale = false;
        }
    }
    span.end(context.command_encoder());
}
