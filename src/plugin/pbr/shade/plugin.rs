//! Set-up of shading: adds the systems to their schedules.
//!
//! In: an app in which captures are drawn, with Bevy's `PbrPlugin`. Out: the same app, in which fog, shadows and light
//! change captures. Without `PbrPlugin` captures are not shaded.

use super::draw::{ShadeViews, any_request, any_shade_view, prepare_shade, shade_captures};
use super::extract::{ExtractedShading, any_shading, extract_shading};
use super::pipeline::{ShadePipeline, ShadeShader, init_shade_pipeline};
use crate::plugin::render::CaptureSystems;
use crate::plugin::render::targets::checked_pipelines::CheckedPipelines;
use bevy::app::App;
use bevy::asset::Assets;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::pbr::MeshPipelineSystems;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};
use bevy::shader::Shader;

/// Shades captures: adds the systems and resources, if there is a render world.
pub(in crate::plugin::pbr) fn build(app: &mut App) {
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    let Some(mut shaders) = app.world_mut().get_resource_mut::<Assets<Shader>>() else { return };
    let source = include_str!("../../../../shaders/pbr/shade.wgsl");
    let shader = ShadeShader(shaders.add(Shader::from_wgsl(source, "bevy_gs4d/shaders/pbr/shade.wgsl")));
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .insert_resource(shader)
        .init_resource::<ExtractedShading>()
        // Created again after a lost device: these resources hold all GPU objects.
        .init_gpu_resource::<CheckedPipelines<ShadePipeline>>()
        .init_gpu_resource::<ShadeViews>()
        .add_systems(RenderStartup, init_shade_pipeline.after(MeshPipelineSystems))
        .add_systems(ExtractSchedule, extract_shading.run_if(any_shading))
        .add_systems(Render, prepare_shade.run_if(any_request).in_set(RenderSystems::Prepare))
        .add_systems(Core3d, shade_captures.run_if(any_shade_view).in_set(CaptureSystems::Shade));
}
