//! Draw: captures into a camera's target, in Bevy's `Core3d` schedule.
//!
//! In: the camera's view, prepared by [`prepare`](super::prepare). Out: one compute pass, the composite and, if the
//! camera asks for it, `write_depth` and `write_motion`, recorded. If other systems work on the captures' picture before it reaches the target,
//! the compute pass is recorded before them.

use super::active::ActiveLists;
use super::capture_views::{CaptureView, CaptureViews};
use super::composite::CompositePipeline;
use super::renderer::CaptureRenderer;
use super::upload::GpuGaussianCapture;
use super::write_depth::WriteDepthPipeline;
use super::write_motion::WriteMotionPipeline;
use crate::renderer::WorkCounters;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Res, ResMut, SystemParam};
use bevy::log::debug_span;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    LoadOp, Operations, PipelineCache, RenderPassColorAttachment, RenderPassDepthStencilAttachment,
    RenderPassDescriptor, StoreOp,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{Msaa, ViewDepthTexture, ViewTarget};

/// Sets of systems in the render world's `Core3d` schedule, for ordering.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum CaptureSystems {
    /// The renderer draws captures into a picture of their own, after opaque meshes, if [`Shade`](Self::Shade) needs it.
    Record,
    /// That picture is changed before it reaches the target.
    Shade,
    /// Captures are drawn after opaque meshes and before transparent ones. Passes of others between the two (transmission) should be
    /// ordered against it.
    Draw,
    /// Captures of multisampled cameras, and of those whose [settings](super::CaptureViewSettings::late) ask for it, are drawn after
    /// transparent meshes.
    DrawLate,
}

/// The pipelines, and the device that creates their bind groups.
#[derive(SystemParam)]
pub(super) struct Passes<'w> {
    device: Res<'w, RenderDevice>,
    cache: Res<'w, PipelineCache>,
    composite: Res<'w, CompositePipeline>,
    write_depth: Res<'w, WriteDepthPipeline>,
    write_motion: Res<'w, WriteMotionPipeline>,
}

/// Draws the captures of one camera into a picture of their own, if others work on it before the composite.
pub(super) fn record_captures(
    camera: ViewQuery<()>,
    renderer: Option<Res<CaptureRenderer>>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    lists: Res<ActiveLists>,
    passes: Passes,
    mut views: ResMut<CaptureViews>,
    mut context: RenderContext,
) {
    let (Some(renderer), Some(view)) = (renderer, views.0.get_mut(&camera.entity())) else { return };
    if view.is_shaded && passes.can_draw(view) {
        passes.record(view, &renderer, &captures, &lists, &mut context);
    }
}

/// Draws the captures of one camera. Registered twice, because multisampled targets can be read only once they have been resolved, which
/// is after transparent meshes.
pub(super) fn draw_captures<const LATE: bool>(
    camera: ViewQuery<(&ViewTarget, &ViewDepthTexture, &Msaa, Option<&ViewPrepassTextures>)>,
    renderer: Option<Res<CaptureRenderer>>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    lists: Res<ActiveLists>,
    passes: Passes,
    mut views: ResMut<CaptureViews>,
    mut context: RenderContext,
) {
    let _span = debug_span!("gs4d/draw").entered();
    let entity = camera.entity();
    let (target, depth, msaa, prepass) = camera.into_inner();
    let (Some(renderer), Some(view)) = (renderer, views.0.get_mut(&entity)) else { return };
    if (*msaa != Msaa::Off || view.late) != LATE {
        return;
    }
    if !passes.can_draw(view) {
        return;
    }
    if !view.is_shaded {
        passes.record(view, &renderer, &captures, &lists, &mut context);
    }
    passes.composite(view, target, &mut context, renderer.0.work());
    passes.write_depth(view, depth, &mut context, renderer.0.work());
    if let Some(prepass) = prepass {
        passes.write_motion(view, prepass, &mut context, renderer.0.work());
    }
}

impl Passes<'_> {
    /// Returns whether there is anything to draw. Without the composite the work would stay invisible.
    fn can_draw(&self, view: &CaptureView) -> bool {
        view.sees_something() && self.cache.get_render_pipeline(view.composite).is_some()
    }

    /// Records the renderer's compute pass.
    fn record(
        &self,
        view: &mut CaptureView,
        renderer: &CaptureRenderer,
        captures: &RenderAssets<GpuGaussianCapture>,
        lists: &ActiveLists,
        context: &mut RenderContext,
    ) {
        let instances = view.instances(captures, lists);
        let diagnostics = context.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let span = diagnostics.time_span(context.command_encoder(), "gs4d");
        view.renderer.record(&renderer.0, context.command_encoder(), &instances);
        span.end(context.command_encoder());
    }

    /// Draws captures over the target.
    fn composite(&self, view: &mut CaptureView, target: &ViewTarget, context: &mut RenderContext, work: &WorkCounters) {
        // Fetched before `post_process_write` swaps the target's textures: from then on, the other one must be written.
        let Some(pipeline) = self.cache.get_render_pipeline(view.composite) else { return };
        let Some(color) = view.shaded.as_ref().or(view.renderer.color()) else { return };
        let source = (!view.in_place).then(|| target.main_texture_view());
        let group = view.bindings.group(&self.device, &self.cache, &self.composite, source, color, work);
        let Some(group) = group else { return };
        let attachment = if view.in_place {
            target.get_unsampled_color_attachment()
        } else {
            RenderPassColorAttachment {
                view: target.post_process_write().destination,
                depth_slice: None,
                resolve_target: None,
                ops: Operations::default(),
            }
        };
        let diagnostics = context.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("gs4d composite"),
            color_attachments: &[Some(attachment)],
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

    /// Writes captures into the depth buffer, if the camera asks for it.
    fn write_depth(
        &self,
        view: &mut CaptureView,
        depth: &ViewDepthTexture,
        context: &mut RenderContext,
        work: &WorkCounters,
    ) {
        let Some(pipeline) = view.write_depth.and_then(|id| self.cache.get_render_pipeline(id)) else { return };
        let (Some(color), Some(depths)) = (view.renderer.color(), view.renderer.depth()) else { return };
        let Some(viewport) = view.bindings.viewport() else { return };
        let targets = [color, depths];
        let group = view.depth_bindings.group(&self.device, &self.cache, &self.write_depth, viewport, targets, work);
        let Some(group) = group else { return };
        let diagnostics = context.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("gs4d write_depth"),
            color_attachments: &[],
            depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, "gs4d/write_depth");
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
        span.end(&mut pass);
    }

    /// Writes captures into the camera's motion vectors and the depths of its prepass, if it has them.
    fn write_motion(
        &self,
        view: &mut CaptureView,
        prepass: &ViewPrepassTextures,
        context: &mut RenderContext,
        work: &WorkCounters,
    ) {
        let Some(pipeline) = view.write_motion.and_then(|id| self.cache.get_render_pipeline(id)) else { return };
        let (Some(vectors), Some(prepass_depth)) = (&prepass.motion_vectors, &prepass.depth) else { return };
        let (Some(motions), Some(depths)) = (view.renderer.motion(), view.renderer.depth()) else { return };
        let (Some(viewport), Some(distance)) = (view.bindings.viewport(), view.depth_bindings.lens()) else {
            return;
        };
        let (uniforms, targets) = ([viewport, distance], [motions, depths]);
        let group = view.motion_bindings.group(&self.device, &self.cache, &self.write_motion, uniforms, targets, work);
        let Some(group) = group else { return };
        let diagnostics = context.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let depth_ops = Operations { load: LoadOp::Load, store: StoreOp::Store };
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("gs4d write_motion"),
            color_attachments: &[Some(vectors.get_attachment())],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &prepass_depth.texture.default_view,
                depth_ops: Some(depth_ops),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, "gs4d/write_motion");
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
        span.end(&mut pass);
    }
}
