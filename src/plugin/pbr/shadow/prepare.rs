//! Prepare: collects the captures in each view of a light and prepares the renderer's working buffers.
//!
//! In: [`ExtractedCasters`], [`CaptureCut`], the views of lights whose shadow maps Bevy draws this frame. Out: [`LightViews`], with all
//! inputs of drawing written to the GPU. In the steady state no GPU object is created.

use super::casts::ShadowResolution;
use super::extract::{Caster, ExtractedCasters};
use super::light_lens::LightLens;
use super::light_views::{LightView, LightViews};
use crate::plugin::render::captures::back_off::BackOff;
use crate::plugin::render::logged::{error_once_each, warn_once_each};
use crate::plugin::render::targets::checked_pipelines::CheckedPipelines;
use crate::plugin::render::{
    ActiveLists, CaptureCut, CaptureRenderer, Drawn, ExtractedCaptures, GpuGaussianCapture, WriteDepthKey,
    WriteDepthPipeline, WrittenDepth, group_copies,
};
use crate::renderer::device::memory::catch_known;
use crate::renderer::{ColorPrecision, GpuError, Instance, ViewParameters};
use crate::view::{Appearance, Background, BlendSpace, DebugView};
use bevy::camera::primitives::Frustum;
use bevy::camera::visibility::RenderLayers;
use bevy::ecs::query::With;
use bevy::ecs::system::{Query, Res, ResMut, SystemParam};
use bevy::log::debug_span;
use bevy::pbr::{Shadow, ShadowView};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_phase::ViewBinnedRenderPhases;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, RetainedViewEntity};
use glam::UVec2;

/// The parameters of drawing captures for a shadow: only depths are used.
const PARAMETERS: ViewParameters<'static> = ViewParameters {
    background: Background::None,
    opaque: None,
    blend_space: BlendSpace::Encoded,
    debug: DebugView::Color,
    depths: true,
    precision: ColorPrecision::Half,
    previous: None,
};

/// The captures that cast shadows this frame.
#[derive(SystemParam)]
pub(super) struct Casters<'w> {
    casters: Res<'w, ExtractedCasters>,
    extracted: Res<'w, ExtractedCaptures>,
    captures: Res<'w, RenderAssets<GpuGaussianCapture>>,
    lists: Res<'w, ActiveLists>,
    cut: Res<'w, CaptureCut>,
}

impl Casters<'_> {
    /// Returns the captures that reach into a view of a light for a camera, in the same order in every frame.
    fn within(&self, frustum: &Frustum, layers: &RenderLayers, camera: MainEntity) -> Vec<&Caster> {
        // Bevy has moved the near planes of directional lights to infinity.
        let reaches = |caster: &&Caster| {
            caster.layers.intersects(layers)
                && caster.in_range.of(camera)
                && frustum.intersects_obb(&caster.bounds, &caster.world_from_capture, true, true)
        };
        self.casters.0.iter().filter(reaches).collect()
    }

    /// Returns one capture as drawn for a light; `None` if it is not drawn.
    fn drawn(&self, caster: &Caster, lens: &LightLens, size: UVec2) -> Option<Drawn> {
        let placed = self.extracted.0.get(&caster.entity)?;
        let capture = self.captures.get(placed.asset)?;
        let time = capture.time_at(placed.seconds)?;
        let view = lens.view(size, time, &caster.bounds, caster.world_from_capture, caster.bias)?;
        let level = usize::from(placed.finest_level).min(capture.coarsest());
        let view = view.with_optics(capture.optics(level, false)?);
        let thinning = self.cut.thinning(&view, &capture.thinned(level)?, placed.priority);
        let (asset, appearance) = (placed.asset, Appearance { thinning, ..placed.appearance });
        let filtered = placed.filtered;
        Some(Drawn { entity: caster.entity, asset, view, appearance, filtered, level })
    }
}

/// Prepares the views of all lights: the captures in them and their working buffers.
pub(super) fn prepare_light_views(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    renderer: Option<Res<CaptureRenderer>>,
    casters: Casters,
    cache: Res<PipelineCache>,
    write_depth: Res<WriteDepthPipeline>,
    mut depth_writers: ResMut<CheckedPipelines<WriteDepthPipeline>>,
    phases: Res<ViewBinnedRenderPhases<Shadow>>,
    mut views: ResMut<LightViews>,
    mut back_off: ResMut<BackOff<RetainedViewEntity>>,
    lights: Query<(&ExtractedView, &Frustum, Option<&RenderLayers>), With<ShadowView>>,
) {
    let _span = debug_span!("gs4d/shadows").entered();
    let Some(renderer) = renderer else { return };
    back_off.count_frame();
    for state in views.0.values_mut() {
        state.live = false;
    }
    for (light, frustum, layers) in &lights {
        let key = light.retained_view_entity;
        if !phases.contains_key(&key) || back_off.contains(&key) {
            continue;
        }
        let within = casters.within(frustum, layers.unwrap_or_default(), key.auxiliary_entity);
        if within.is_empty() && !views.0.contains_key(&key) {
            continue;
        }
        let prepared = catch_known(device.wgpu_device(), 0, || {
            let state = views.0.entry(key).or_insert_with(|| {
                let key = WriteDepthKey { samples: 1, depth: WrittenDepth::Farther };
                let pipeline = depth_writers.specialize(&device, &cache, &write_depth, key);
                LightView::new(&device, &renderer.0, pipeline)
            });
            prepare_light_view(state, light, &within, &casters, (&*device, &*queue, &*renderer))
        });
        let failure = match prepared {
            Ok(Ok(())) => continue,
            Ok(Err(failure)) if !failure.is_of_device() => failure,
            Ok(Err(failure)) | Err(failure) => {
                // Objects of the view are invalid.
                views.0.remove(&key);
                back_off.begin(key);
                failure
            }
        };
        error_once_each(&format!("captures cast no shadows: {failure}"));
    }
    for state in views.0.values_mut().filter(|state| !state.live) {
        state.drawn.clear();
        state.count_idle_frames();
    }
    views.0.retain(|_, state| !state.is_over());
}

/// Prepares one view of a light.
///
/// # Errors
/// When there is no room for the captures in the view. None is drawn then.
fn prepare_light_view(
    state: &mut LightView,
    light: &ExtractedView,
    within: &[&Caster],
    casters: &Casters,
    (device, queue, renderer): (&RenderDevice, &RenderQueue, &CaptureRenderer),
) -> Result<(), GpuError> {
    state.live = true;
    state.drawn.clear();
    let map = UVec2::new(light.viewport.z, light.viewport.w);
    let scale = scale(map, within.iter().map(|caster| caster.resolution));
    let boxes = within.iter().map(|caster| (&caster.bounds, caster.world_from_capture));
    let lens = LightLens::of(&light.clip_from_view, light.world_from_view.affine(), boxes);
    if let Some(lens) = &lens {
        let drawn = within.iter().filter_map(|caster| casters.drawn(caster, lens, map / scale));
        state.drawn.extend(drawn);
        group_copies(&mut state.drawn);
    }
    state.count_idle_frames();
    let Some(lens) = lens.filter(|_| !state.drawn.is_empty()) else { return Ok(()) };
    state.set_map(map, device, queue, renderer.0.work());
    state.depth_bindings.set_lens(lens.distance, scale, device, queue, renderer.0.work());
    let instances: Vec<Instance> =
        state.drawn.iter().filter_map(|drawn| drawn.instance(&casters.captures, &casters.lists)).collect();
    let prepared = state.renderer.prepare(device.wgpu_device(), queue, &renderer.0, &instances, &PARAMETERS);
    if prepared.is_err() {
        state.drawn.clear();
    } else if state.renderer.is_short_of_room() {
        warn_once_each(
            "shadows of captures are drawn whole but slowly: a view of a light has more pairs of splats and tiles than \
             fit on this GPU; let fewer captures cast shadows, or cast them at a lower CastsShadows::resolution",
        );
    }
    prepared
}

/// Returns the side of a pixel in texels for the finest resolution, reduced until it divides the size of the map.
fn scale(map: UVec2, resolutions: impl Iterator<Item = ShadowResolution>) -> u32 {
    let wanted = resolutions.min().unwrap_or_default().scale();
    let divides = |scale: &u32| map % *scale == UVec2::ZERO;
    [wanted, wanted / 2].into_iter().filter(|scale| *scale > 0).find(divides).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ShadowResolution::{Full, Half, Quarter};

    #[test]
    fn the_finest_resolution_is_used_and_divides_the_map() {
        let map = UVec2::splat(512);
        assert_eq!(scale(map, [Quarter, Half].into_iter()), 2, "the finer of two resolutions");
        assert_eq!(scale(map, [Quarter, Full].into_iter()), 1, "one pixel per texel");
        assert_eq!(scale(map, [Quarter].into_iter()), 4, "a single resolution");
        assert_eq!(scale(UVec2::splat(514), [Quarter].into_iter()), 2, "a map size that 4 does not divide");
        assert_eq!(scale(UVec2::splat(513), [Quarter].into_iter()), 1, "a map size that 2 does not divide");
    }
}
