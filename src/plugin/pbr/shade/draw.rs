//! Draw: records the pass `shade` in Bevy's `Core3d` schedule.
//!
//! In: cameras whose captures are shaded, with the captures' picture and depths. Out: for each such camera a pipeline,
//! kept while it may be needed, and a shaded picture, which the composite uses instead of the original one.

use super::extract::ExtractedShading;
use super::pipeline::{FORMAT, ShadePipeline};
use super::uniform::GpuSettings;
use crate::plugin::render::CaptureStatistics;
use crate::plugin::render::captures::extract::ExtractedViewSettings;
use crate::plugin::render::targets::bindings::{CachedUniform, created};
use crate::plugin::render::targets::checked_pipelines::CheckedPipelines;
use crate::plugin::render::views::capture_views::{CaptureView, CaptureViews};
use crate::plugin::render::views::shade_requests::ShadeRequests;
use crate::renderer::WorkCounters;
use crate::view::BlendSpace;
use bevy::camera::Camera3d;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut, SystemParam};
use bevy::log::debug_span;
use bevy::pbr::{MeshViewBindGroup, ViewKeyCache};
use bevy::platform::collections::HashMap;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, CachedRenderPipelineId, Operations, PipelineCache, RenderPassColorAttachment,
    RenderPassDescriptor,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::ExtractedView;

/// State of every camera whose captures may be shaded, by its entity in the render world.
#[derive(Resource, Default)]
pub(super) struct ShadeViews(HashMap<Entity, ShadeView>);

/// Returns whether the captures of any camera may be shaded.
pub(super) fn any_shade_view(shades: Res<ShadeViews>) -> bool {
    !shades.0.is_empty()
}

/// Returns whether there is a request for a shaded picture, or state of an earlier request.
pub(super) fn any_request(requests: Res<ShadeRequests>, shades: Res<ShadeViews>) -> bool {
    !(requests.cameras.is_empty() && requests.captures.is_empty() && shades.0.is_empty())
}

/// State of one camera.
struct ShadeView {
    /// `None` if the GPU refuses the pipeline. Captures are drawn unshaded then.
    pipeline: Option<CachedRenderPipelineId>,
    settings: CachedUniform<GpuSettings>,
    /// Absent until captures are shaded.
    targets: Option<Targets>,
}

/// The shaded picture, and the bindings of its pass.
struct Targets {
    colors: wgpu::TextureView,
    depths: wgpu::TextureView,
    shaded: wgpu::TextureView,
    group: BindGroup,
}

/// Requests the pipeline of every camera that may need one, so that it is compiled while captures load.
pub(super) fn prepare_shade(
    device: Res<RenderDevice>,
    pipeline: Option<Res<ShadePipeline>>,
    keys: Option<Res<ViewKeyCache>>,
    cache: Res<PipelineCache>,
    requests: Res<ShadeRequests>,
    mut pipelines: ResMut<CheckedPipelines<ShadePipeline>>,
    mut shades: ResMut<ShadeViews>,
    cameras: Query<(Entity, &ExtractedView), With<Camera3d>>,
) {
    let (Some(pipeline), Some(keys)) = (pipeline, keys) else { return };
    let may_need = |view: &ExtractedView| {
        !requests.captures.is_empty() || requests.cameras.contains(&view.retained_view_entity.main_entity)
    };
    shades.0.retain(|&camera, _| cameras.get(camera).is_ok_and(|(_, view)| may_need(view)));
    for (entity, view) in cameras.iter().filter(|(_, view)| may_need(view)) {
        let Some(&key) = keys.get(&view.retained_view_entity) else { continue };
        let pipeline = pipelines.specialize(&device, &cache, &pipeline, key);
        let new = || ShadeView { pipeline, settings: CachedUniform::default(), targets: None };
        shades.0.entry(entity).or_insert_with(new).pipeline = pipeline;
    }
}

/// The resources of shading, except the views.
#[derive(SystemParam)]
pub(super) struct Shading<'w> {
    device: Res<'w, RenderDevice>,
    queue: Res<'w, RenderQueue>,
    cache: Res<'w, PipelineCache>,
    pipeline: Option<Res<'w, ShadePipeline>>,
    extracted: Res<'w, ExtractedShading>,
    view_settings: Res<'w, ExtractedViewSettings>,
    statistics: Res<'w, CaptureStatistics>,
}

/// Shades the captures of one camera. While the pipeline is being compiled, captures are drawn unshaded.
pub(super) fn shade_captures(
    camera: ViewQuery<(&ExtractedView, &MeshViewBindGroup)>,
    shading: Shading,
    mut shades: ResMut<ShadeViews>,
    mut views: ResMut<CaptureViews>,
    mut context: RenderContext,
) {
    let _span = debug_span!("gs4d/shade").entered();
    let entity = camera.entity();
    let (bevy_view, bound) = camera.into_inner();
    let (Some(view), Some(shade)) = (views.0.get_mut(&entity), shades.0.get_mut(&entity)) else { return };
    if !(view.is_shaded && view.sees_something()) {
        shade.targets = None;
        return;
    }
    let Some(pipeline) = shade.pipeline.and_then(|id| shading.cache.get_render_pipeline(id)) else { return };
    let main = bevy_view.retained_view_entity.main_entity;
    let blend_space = shading.view_settings.0.get(&main).copied().unwrap_or_default().blend_space;
    let Some(settings) = shading.settings(view, blend_space) else { return };
    let Some(targets) = shading.targets(shade, view, settings) else { return };
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("gs4d shade"),
        color_attachments: &[Some(RenderPassColorAttachment {
            view: &targets.shaded,
            depth_slice: None,
            resolve_target: None,
            ops: Operations::default(),
        })],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "gs4d/shade");
    // The texture may be larger than the view.
    pass.set_scissor_rect(0, 0, settings.size.x, settings.size.y);
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &bound.main, &bound.main_offsets);
    pass.set_bind_group(1, &bound.binding_array, &[]);
    pass.set_bind_group(2, &targets.group, &[]);
    pass.draw(0..3, 0..1);
    span.end(&mut pass);
    view.shaded = Some(targets.shaded.clone());
}

impl Shading<'_> {
    /// Returns the shading settings of a view; `None` if it draws no capture.
    fn settings(&self, view: &CaptureView, blend_space: BlendSpace) -> Option<GpuSettings> {
        let size = view.drawn.first()?.view.size;
        let drawn = view.drawn.iter().filter_map(|drawn| self.extracted.0.get(&drawn.entity));
        Some(GpuSettings::new(size, blend_space == BlendSpace::Linear, drawn))
    }

    /// Writes the shading settings of a view if they have changed, and returns the shaded picture, which is created
    /// again if the captures' picture has changed; `None` if the GPU has no memory for it.
    fn targets<'a>(&self, shade: &'a mut ShadeView, view: &CaptureView, settings: GpuSettings) -> Option<&'a Targets> {
        let (colors, depths) = (view.renderer.color()?, view.renderer.depth()?);
        let work = self.statistics.work();
        created(&self.device, || {
            shade.settings.set(settings, &self.device, &self.queue, &work);
            if shade.targets.as_ref().is_none_or(|known| known.colors != *colors || known.depths != *depths) {
                let layout = self.cache.get_bind_group_layout(&self.pipeline.as_ref()?.layout);
                let entries = BindGroupEntries::sequential((colors, depths, shade.settings.binding()?));
                let group = self.device.create_bind_group("gs4d shade", &layout, &entries);
                work.add_created();
                let shaded = self.picture(colors, &work);
                shade.targets = Some(Targets { colors: colors.clone(), depths: depths.clone(), shaded, group });
            }
            Some(())
        })
        .or_else(|| {
            // They are created again in the next frame.
            shade.targets = None;
            None
        })??;
        shade.targets.as_ref()
    }

    /// Creates a picture of the size of the captures' picture.
    fn picture(&self, colors: &wgpu::TextureView, work: &WorkCounters) -> wgpu::TextureView {
        let texture = self.device.wgpu_device().create_texture(&wgpu::TextureDescriptor {
            label: Some("gs4d shaded"),
            size: colors.texture().size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        work.add_created();
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    }
}
