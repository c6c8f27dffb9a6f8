//! Draw: draws captures into a camera's target, in Bevy's `Core3d` schedule.
//!
//! In: the camera's view, prepared by [`prepare`](super::prepare), and its [`order`](super::order). Out: one compute
//! pass, the composite and, if the camera requests it, `write_depth` and `write_motion`; then the transparent items in
//! front. If other systems change the captures' picture before it reaches the target, the compute pass is recorded
//! before them.

use super::capture_views::{CaptureView, CaptureViews};
use super::order::CaptureOrders;
use crate::plugin::render::captures::active::ActiveLists;
use crate::plugin::render::captures::upload::GpuGaussianCapture;
use crate::plugin::render::renderer::CaptureRenderer;
use crate::plugin::render::targets::composite::CompositePipeline;
use crate::plugin::render::targets::write_depth::WriteDepthPipeline;
use crate::plugin::render::targets::write_motion::WriteMotionPipeline;
use crate::renderer::WorkCounters;
use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::core_pipeline::core_3d::Transparent3d;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Res, ResMut, SystemParam};
use bevy::ecs::world::World;
use bevy::log::{debug_span, error};
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_phase::ViewSortedRenderPhases;
use bevy::render::render_resource::{
    LoadOp, Operations, PipelineCache, RenderPassColorAttachment, RenderPassDepthStencilAttachment,
    RenderPassDescriptor, StoreOp,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ExtractedView, Msaa, ViewDepthTexture, ViewTarget};

/// Sets of systems in the render world's `Core3d` schedule, for ordering.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum CaptureSystems {
    /// Draws captures into a separate picture after opaque meshes, if [`Shade`](Self::Shade) needs it.
    Record,
    /// Changes the separate picture before it reaches the target.
    Shade,
    /// Draws captures behind a transmissive mesh, after opaque meshes and before transmissive meshes.
    Draw,
    /// Draws all other captures, after the transparent items behind them and before those in front of them.
    DrawLate,
}

/// The pipelines, and the device that creates their bind groups.
#[derive(SystemParam)]
pub(in crate::plugin::render) struct Passes<'w> {
    device: Res<'w, RenderDevice>,
    cache: Res<'w, PipelineCache>,
    composite: Res<'w, CompositePipeline>,
    write_depth: Res<'w, WriteDepthPipeline>,
    write_motion: Res<'w, WriteMotionPipeline>,
}

/// Draws the captures of one camera into a separate picture, if other systems change it before the composite.
pub(in crate::plugin::render) fn record_captures(
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

/// Draws the captures of one camera. Registered twice: before transmissive meshes, and `LATE`, among transparent items.
pub(in crate::plugin::render) fn draw_captures<const LATE: bool>(
    camera: ViewQuery<(&ViewTarget, &ViewDepthTexture, &Msaa, Option<&ViewPrepassTextures>)>,
    renderer: Option<Res<CaptureRenderer>>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    lists: Res<ActiveLists>,
    orders: Res<CaptureOrders>,
    passes: Passes,
    mut views: ResMut<CaptureViews>,
    mut context: RenderContext,
) {
    let _span = debug_span!("gs4d/draw").entered();
    let entity = camera.entity();
    let (target, depth, msaa, prepass) = camera.into_inner();
    let (Some(renderer), Some(view)) = (renderer, views.0.get_mut(&entity)) else { return };
    let order = orders.of(entity);
    if order.early == LATE {
        return;
    }
    if !passes.can_draw(view) {
        return;
    }
    if !view.is_shaded {
        passes.record(view, &renderer, &captures, &lists, &mut context);
    }
    let into_samples = *msaa != Msaa::Off && order.needs_samples();
    passes.composite(view, target, into_samples, &mut context, renderer.0.work());
    passes.write_depth(view, depth, &mut context, renderer.0.work());
    if let Some(prepass) = prepass {
        passes.write_motion(view, prepass, &mut context, renderer.0.work());
    }
}

/// Draws the transparent items in front of the captures of one camera, as Bevy's own pass does.
pub(in crate::plugin::render) fn draw_front(
    world: &World,
    camera: ViewQuery<(
        &ExtractedCamera,
        &ExtractedView,
        &ViewTarget,
        &ViewDepthTexture,
        Option<&MainPassResolutionOverride>,
    )>,
    phases: Res<ViewSortedRenderPhases<Transparent3d>>,
    orders: Res<CaptureOrders>,
    mut context: RenderContext,
) {
    let entity = camera.entity();
    let (camera, view, target, depth, resolution) = camera.into_inner();
    let (Some(front), Some(phase)) = (orders.of(entity).front, phases.get(&view.retained_view_entity)) else { return };
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("gs4d front"),
        color_attachments: &[Some(target.get_color_attachment())],
        depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "gs4d/front");
    if let Some(viewport) = Viewport::from_viewport_and_override(camera.viewport.as_ref(), resolution) {
        pass.set_camera_viewport(&viewport);
    }
    if let Err(failure) = phase.render_range(&mut pass, world, entity, front..) {
        error!("transparent items in front of captures are not drawn: {failure}");
    }
    span.end(&mut pass);
}

impl Passes<'_> {
    /// Returns whether the view has captures and its composite, without which they would not be visible, is compiled.
    fn can_draw(&self, view: &CaptureView) -> bool {
        let mut composites = view.composite.into_iter().chain(view.composite_samples);
        let is_visible = view.sees_something() && view.composite.is_some();
        is_visible && composites.all(|id| self.cache.get_render_pipeline(id).is_some())
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

    /// Draws captures over the target; with `into_samples` over each sample, so that later passes can resolve them.
    fn composite(
        &self,
        view: &mut CaptureView,
        target: &ViewTarget,
        into_samples: bool,
        context: &mut RenderContext,
        work: &WorkCounters,
    ) {
        let id = if into_samples { view.composite_samples } else { view.composite };
        let Some(pipeline) = id.and_then(|id| self.cache.get_render_pipeline(id)) else { return };
        let Some(color) = view.shaded.as_ref().or(view.renderer.color()) else { return };
        // The texture to read, before `post_process_write` swaps the target's textures.
        let source = (!view.in_place).then(|| target.main_texture_view());
        let group = view.bindings.group(&self.device, &self.cache, &self.composite, source, color, work);
        let Some(group) = group else { return };
        let attachment = match (view.in_place, into_samples) {
            (true, false) => target.get_unsampled_color_attachment(),
            (true, true) => target.get_color_attachment(),
            (false, false) => RenderPassColorAttachment {
                view: target.post_process_write().destination,
                depth_slice: None,
                resolve_target: None,
                // Every pixel is written, so clearing first would waste time.
                ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
            },
            (false, true) => {
                // Both textures have the same samples, which are resolved into the texture that is not read.
                target.post_process_write();
                target.get_color_attachment()
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

    /// Writes captures into the depth buffer, if the camera requests it.
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
        let Some(vectors) = &prepass.motion_vectors else { return };
        let (Some(motions), Some(depths)) = (view.renderer.motion(), view.renderer.depth()) else { return };
        let (Some(viewport), Some(lens)) = (view.bindings.viewport(), view.depth_bindings.lens()) else {
            return;
        };
        let (textures, uniforms) = ([motions, depths], [viewport, lens]);
        let create = || Some(self.write_motion.group(&self.device, &self.cache, textures, uniforms));
        let group = view.motion_group.of(&self.device, textures, work, create);
        let Some(group) = group else { return };
        let diagnostics = context.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let depth_ops = Operations { load: LoadOp::Load, store: StoreOp::Store };
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("gs4d write_motion"),
            color_attachments: &[Some(vectors.get_attachment())],
            depth_stencil_attachment: prepass.depth.as_ref().map(|depth| RenderPassDepthStencilAttachment {
                view: &depth.texture.default_view,
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
