//! Draw: records the pass `contact_shadow` in Bevy's `Core3d` schedule.
//!
//! In: [`ContactShadowViews`]; a camera's target and the depth of its opaque meshes. Out: the target with the contact
//! shadows that the camera sees. While the pipeline is being compiled, no shadow is drawn.

use super::prepare::ContactShadowViews;
use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::ecs::system::Res;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{PipelineCache, RenderPassDescriptor, StoreOp};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewDepthTexture, ViewTarget};

/// Draws the contact shadows that one camera sees.
pub(super) fn draw_contact_shadows(
    camera: ViewQuery<(&ExtractedCamera, &ViewTarget, &ViewDepthTexture, Option<&MainPassResolutionOverride>)>,
    cache: Res<PipelineCache>,
    views: Res<ContactShadowViews>,
    mut context: RenderContext,
) {
    let Some(view) = views.cameras.get(&camera.entity()) else { return };
    let (Some(pipeline), Some(ellipses)) = (cache.get_render_pipeline(view.pipeline), views.ellipses.buffer()) else {
        return;
    };
    let (camera, target, depth, resolution) = camera.into_inner();
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("gs4d contact_shadow"),
        color_attachments: &[Some(target.get_color_attachment())],
        depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "gs4d/contact_shadow");
    if let Some(viewport) = Viewport::from_viewport_and_override(camera.viewport.as_ref(), resolution) {
        pass.set_camera_viewport(&viewport);
    }
    pass.set_render_pipeline(pipeline);
    pass.set_vertex_buffer(0, ellipses.slice(..));
    pass.draw(0..4, view.ellipses.clone());
    span.end(&mut pass);
}
