//! Draw: draws captures into the shadow maps of lights, in Bevy's `Core3d` schedule, after meshes.
//!
//! In: the views of lights, prepared by [`prepare`](super::prepare). Out: for each view one compute pass and
//! `write_depth` into the map.

use super::light_views::LightViews;
use crate::plugin::render::{ActiveLists, CaptureRenderer, GpuGaussianCapture, WriteDepthPipeline};
use crate::renderer::Instance;
use bevy::core_pipeline::schedule::RootNonCameraView;
use bevy::ecs::query::With;
use bevy::ecs::system::{Query, Res, ResMut, SystemParam};
use bevy::pbr::{ShadowView, ViewLightEntities};
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{PipelineCache, RenderPassDescriptor, StoreOp};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::ExtractedView;

/// The views of lights, and the resources of drawing into them.
#[derive(SystemParam)]
pub(super) struct Casting<'w> {
    device: Res<'w, RenderDevice>,
    cache: Res<'w, PipelineCache>,
    write_depth: Res<'w, WriteDepthPipeline>,
    renderer: Option<Res<'w, CaptureRenderer>>,
    captures: Res<'w, RenderAssets<GpuGaussianCapture>>,
    lists: Res<'w, ActiveLists>,
    views: ResMut<'w, LightViews>,
}

/// Draws captures into the map of a spot light or of one face of a point light, which all cameras share.
pub(super) fn cast_shared(
    light: ViewQuery<(&ShadowView, &ExtractedView), With<RootNonCameraView>>,
    mut casting: Casting,
    mut context: RenderContext,
) {
    let (map, view) = light.into_inner();
    casting.cast(map, view, &mut context);
}

/// Draws captures into the cascades of directional lights for one camera.
pub(super) fn cast_cascades(
    camera: ViewQuery<&ViewLightEntities>,
    lights: Query<(&ShadowView, &ExtractedView)>,
    mut casting: Casting,
    mut context: RenderContext,
) {
    for (map, view) in lights.iter_many(&camera.into_inner().lights) {
        casting.cast(map, view, &mut context);
    }
}

impl Casting<'_> {
    fn cast(&mut self, map: &ShadowView, view: &ExtractedView, context: &mut RenderContext) {
        let Some(renderer) = &self.renderer else { return };
        let Some(state) = self.views.0.get_mut(&view.retained_view_entity) else { return };
        let Some(pipeline) = state.write_depth.and_then(|id| self.cache.get_render_pipeline(id)) else { return };
        if state.drawn.is_empty() {
            return;
        }
        let instances: Vec<Instance> =
            state.drawn.iter().filter_map(|drawn| drawn.instance(&self.captures, &self.lists)).collect();
        let diagnostics = context.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let span = diagnostics.time_span(context.command_encoder(), "gs4d/shadow");
        state.renderer.record(&renderer.0, context.command_encoder(), &instances);
        span.end(context.command_encoder());
        let (Some(color), Some(depths)) = (state.renderer.color(), state.renderer.depth()) else { return };
        let Some(viewport) = state.viewport.binding() else { return };
        let (bindings, work) = (&mut state.depth_bindings, renderer.0.work());
        let group = bindings.group(&self.device, &self.cache, &self.write_depth, viewport, [color, depths], work);
        let Some(group) = group else { return };
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("gs4d shadow"),
            color_attachments: &[],
            depth_stencil_attachment: Some(map.depth_attachment.get_attachment(StoreOp::Store)),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
    }
}
