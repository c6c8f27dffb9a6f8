//! The plugin: what runs where.
//!
//! In: an app with Bevy's `DefaultPlugins` (or at least its `AssetPlugin`). Out: the same app, in which captures load, play and,
//! where there is a renderer, show.

use super::composite::{CompositePipeline, CompositeShader};
use super::draw::{CaptureSystems, draw_captures};
use super::extract::{ExtractedCaptures, extract_captures};
use super::prepare::{CaptureViews, init_renderer, make_depth_readable, prepare_views};
use super::upload::GpuGaussianCapture;
use crate::asset::{CheckpointLoader, GaussianCapture, PackageLoader};
use crate::playback::PlaybackPlugin;
use bevy::app::{App, Plugin};
use bevy::asset::{AssetApp, Assets};
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::render::render_asset::RenderAssetPlugin;
use bevy::render::render_resource::SpecializedRenderPipelines;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};
use bevy::shader::Shader;

/// Loads, plays and draws captures. Add it after `DefaultPlugins`; spawn
/// [`GaussianCapture3d`](super::GaussianCapture3d)s; there is nothing to set on cameras.
#[derive(Debug, Default, Clone, Copy)]
pub struct GaussianCapturePlugin;

impl Plugin for GaussianCapturePlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<GaussianCapture>()
            .init_asset_loader::<PackageLoader>()
            .init_asset_loader::<CheckpointLoader>()
            .add_plugins((PlaybackPlugin, RenderAssetPlugin::<GpuGaussianCapture>::default()));

        let Some(mut shaders) = app.world_mut().get_resource_mut::<Assets<Shader>>() else { return };
        let source = include_str!("../../shaders/composite.wgsl");
        let shader = shaders.add(Shader::from_wgsl(source, "bevy_gs4d/shaders/composite.wgsl"));
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .insert_resource(CompositeShader(shader))
            .init_resource::<ExtractedCaptures>()
            // Made again when a lost device comes back: everything on the GPU hangs on these.
            .init_gpu_resource::<CompositePipeline>()
            .init_gpu_resource::<SpecializedRenderPipelines<CompositePipeline>>()
            .init_gpu_resource::<CaptureViews>()
            .add_systems(RenderStartup, init_renderer)
            .add_systems(ExtractSchedule, extract_captures)
            .add_systems(
                Render,
                (
                    make_depth_readable.in_set(RenderSystems::PrepareViews),
                    prepare_views.in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            .add_systems(
                Core3d,
                (
                    draw_captures::<false>.after(main_opaque_pass_3d).before(main_transparent_pass_3d),
                    draw_captures::<true>.after(main_transparent_pass_3d),
                )
                    .in_set(CaptureSystems::Draw)
                    .in_set(Core3dSystems::MainPass),
            );
    }
}
