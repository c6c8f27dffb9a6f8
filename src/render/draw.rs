//! Draw: captures into a camera's target, in Bevy's `Core3d` schedule.
//!
//! In: what [`prepare`](super::prepare) left for the camera. Out: one compute pass and the composite, recorded.

use super::composite::CompositePipeline;
use super::prepare::{CaptureRenderer, CaptureViews};
use super::upload::GpuGaussianCapture;
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Res, ResMut};
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{Operations, PipelineCache, RenderPassColorAttachment, RenderPassDescriptor};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{Msaa, ViewTarget};

/// Sets of systems in the render world's `Core3d` schedule, for ordering.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum CaptureSystems {
    /// Captures are drawn: after opaque meshes and before transparent ones; for multisampled cameras after both. Passes of others
    /// between opaque and transparent meshes (transmission, an atmosphere) should be ordered against it.
    Draw,
}

/// Draws the captures of one camera. Registered twice: multisampled targets can only be read once they have been resolved, that
/// is after transparent meshes.
pub(super) fn draw_captures<const MULTISAMPLED: bool>(
    camera: ViewQuery<(&ViewTarget, &Msaa)>,
    device: Res<RenderDevice>,
    renderer: Option<Res<CaptureRenderer>>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    composite: Res<CompositePipeline>,
    cache: Res<PipelineCache>,
    mut views: ResMut<CaptureViews>,
    mut context: RenderContext,
) {
    let entity = camera.entity();
    let (target, msaa) = camera.into_inner();
    if (*msaa != Msaa::Off) != MULTISAMPLED {
        return;
    }
    let (Some(renderer), Some(view)) = (renderer, views.0.get_mut(&entity)) else { return };
    let instances = view.instances(&captures);
    let Some(pipeline) = cache.get_render_pipeline(view.pipeline) else { return };
    if instances.is_empty() {
        return;
    }
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "gs4d");
    view.renderer.record(&renderer.0, context.command_encoder(), &instances);
    span.end(context.command_encoder());

    // Fetched before the target is turned round: from then on, something must be written to the other side.
    let Some(color) = view.renderer.color() else { return };
    let source = target.main_texture_view();
    let Some(group) = view.bindings.group(&device, &cache, &composite, source, color) else { return };
    let write = target.post_process_write();
    let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("gs4d composite"),
        color_attachments: &[Some(RenderPassColorAttachment {
            view: write.destination,
            depth_slice: None,
            resolve_target: None,
            ops: Operations::default(),
        })],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "gs4d/composite");
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    pass.draw(0..3, 0..1);
    span.end(&mut pass);
}
