//! The plugin of rendering: adds the systems to the schedules of both worlds.
//!
//! In: an app in which captures load and play. Out: the same app; captures are drawn if it has a renderer.

use super::captures::active::{ActiveLists, any_stale, prepare_active_lists, record_active_lists};
use super::captures::back_off::BackOff;
use super::captures::budget::{CaptureBudget, CaptureCut, any_budget, extract_budget, steer_cut};
use super::captures::detail::{CaptureDetail, CaptureLevels, any_levels, choose_levels, extract_detail};
use super::captures::extract::{
    ExtractedCaptures, ExtractedViewSettings, any_view_settings, extract_captures, extract_view_settings, has_changed,
};
use super::captures::previous::PreviousCaptures;
use super::captures::upload::{
    CaptureUploadBudget, GpuGaussianCapture, any_uploading, continue_uploads, extract_upload_budget,
};
use super::captures::visibility::update_bounds;
use super::renderer::init_renderer;
use super::settings::CaptureSettings;
use super::statistics::CaptureStatistics;
use super::targets::checked_pipelines::CheckedPipelines;
use super::targets::composite::{CaptureShaders, CompositePipeline};
use super::targets::depth_readers::{DepthReaders, extract_depth_readers};
use super::targets::write_depth::WriteDepthPipeline;
use super::targets::write_motion::WriteMotionPipeline;
use super::views::capture_views::{CaptureViews, any_shaded};
use super::views::draw::{CaptureSystems, draw_captures, draw_front, record_captures};
use super::views::order::{
    CaptureOrders, OtherPasses, any_early, any_front, any_ordered, hide_front, place_captures, show_front,
};
use super::views::prepare::{make_depth_readable, prepare_views};
use super::views::shade_requests::ShadeRequests;
use crate::plugin::asset::{Uploads, set_up, set_up_late};
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::playback::require_playback;
use bevy::app::{App, Plugin, PostUpdate, SubApp};
use bevy::asset::Assets;
use bevy::camera::visibility::VisibilitySystems;
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::oit::resolve::node::oit_resolve;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems, camera_driver};
use bevy::ecs::entity::Entity;
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemCondition};
use bevy::log::warn;
use bevy::render::render_asset::{RenderAssetPlugin, prepare_assets};
use bevy::render::renderer::{RenderGraph, RenderGraphSystems};
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};
use bevy::shader::Shader;

/// Draws captures. Part of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins). Without it, or without a
/// renderer, captures are ready once they have been loaded.
#[derive(Debug, Default, Clone, Copy)]
pub struct CaptureRenderPlugin;

impl Plugin for CaptureRenderPlugin {
    fn build(&self, app: &mut App) {
        set_up::<Self>(app, add);
    }

    /// Bevy's `RenderPlugin` may have been added later than this plugin.
    fn finish(&self, app: &mut App) {
        set_up_late::<Self>(app, "CaptureRenderPlugin", add);
        let draws = app.get_sub_app(RenderApp).is_none_or(has_captures);
        if !draws && app.world().contains_resource::<Uploads>() {
            warn!(
                "Bevy's RenderPlugin was added after GaussianCapturePlugins, which were set up to draw only when the \
                 app started: add GaussianCapturePlugins after DefaultPlugins or, in an app without them, after \
                 RenderPlugin"
            );
            build_rendering(app);
        }
    }
}

/// Returns whether captures are drawn by a render world.
pub(crate) fn has_captures(render_app: &SubApp) -> bool {
    render_app.world().contains_resource::<ExtractedCaptures>()
}

fn add(app: &mut App) {
    require_playback(app);
    app.init_resource::<CaptureStatistics>()
        .init_resource::<CaptureUploadBudget>()
        .init_resource::<CaptureDetail>()
        .init_resource::<CaptureBudget>()
        .register_required_components::<GaussianCapture3d, CaptureSettings>()
        .add_systems(PostUpdate, update_bounds.in_set(VisibilitySystems::CalculateBounds));
    build_rendering(app);
}

/// Adds the systems and resources of the render world, if there is one.
fn build_rendering(app: &mut App) {
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    let uploads = app.world().resource::<Uploads>().clone();
    if app.get_sub_app(RenderApp).is_none() {
        statistics.set_renderer_missing(Some("this app has no renderer: add Bevy's RenderPlugin".into()));
        return;
    }
    let Some(shaders) = add_shaders(app) else { return };
    RenderAssetPlugin::<GpuGaussianCapture>::default().build(app);
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    statistics.set_renderer_missing(None);
    uploads.expect();
    render_app
        .insert_resource(shaders)
        .insert_resource(statistics)
        .insert_resource(uploads)
        .init_resource::<CaptureUploadBudget>()
        .init_resource::<CaptureDetail>()
        .init_resource::<CaptureLevels>()
        .init_resource::<CaptureBudget>()
        .init_resource::<CaptureCut>()
        .init_resource::<ExtractedCaptures>()
        .init_resource::<ExtractedViewSettings>()
        .init_resource::<ShadeRequests>()
        .init_resource::<PreviousCaptures>()
        .init_resource::<DepthReaders>()
        .init_resource::<OtherPasses>()
        .init_resource::<CaptureOrders>()
        // Created again after a lost device: these resources hold all GPU objects.
        .init_gpu_resource::<CompositePipeline>()
        .init_gpu_resource::<CheckedPipelines<CompositePipeline>>()
        .init_gpu_resource::<WriteDepthPipeline>()
        .init_gpu_resource::<CheckedPipelines<WriteDepthPipeline>>()
        .init_gpu_resource::<WriteMotionPipeline>()
        .init_gpu_resource::<CheckedPipelines<WriteMotionPipeline>>()
        .init_gpu_resource::<CaptureViews>()
        .init_gpu_resource::<BackOff<Entity>>()
        .init_gpu_resource::<ActiveLists>()
        .add_systems(RenderStartup, init_renderer)
        .add_systems(
            ExtractSchedule,
            (
                extract_captures,
                extract_view_settings.run_if(any_view_settings),
                extract_depth_readers,
                extract_upload_budget.run_if(has_changed::<CaptureUploadBudget>),
                extract_detail.run_if(has_changed::<CaptureDetail>),
                extract_budget,
            ),
        )
        .add_systems(
            Render,
            (
                continue_uploads
                    .run_if(any_uploading)
                    .in_set(RenderSystems::PrepareAssets)
                    .after(prepare_assets::<GpuGaussianCapture>),
                make_depth_readable.in_set(RenderSystems::PrepareViews),
                // Before batching: batches of meshes must end where captures are drawn.
                place_captures
                    .run_if(any_ordered)
                    .in_set(RenderSystems::Prepare)
                    .before(RenderSystems::PrepareResources),
                (steer_cut.run_if(any_budget), choose_levels.run_if(any_levels), prepare_active_lists)
                    .chain()
                    .in_set(RenderSystems::PrepareResources),
                prepare_views.in_set(RenderSystems::PrepareBindGroups),
            ),
        )
        // Recorded, and therefore submitted, before the first camera.
        .add_systems(
            RenderGraph,
            record_active_lists.run_if(any_stale).in_set(RenderGraphSystems::Render).before(camera_driver),
        )
        .configure_sets(
            Core3d,
            CaptureSystems::Shade
                .after(CaptureSystems::Record)
                .before(CaptureSystems::Draw)
                .before(CaptureSystems::DrawLate)
                .in_set(Core3dSystems::MainPass),
        )
        // Most cameras need one of these systems. An idle system may wake a thread, and costs more than its condition.
        .add_systems(
            Core3d,
            (
                record_captures
                    .run_if(any_shaded)
                    .after(main_opaque_pass_3d)
                    .before(main_transparent_pass_3d)
                    .in_set(CaptureSystems::Record),
                draw_captures::<false>
                    .run_if(any_early)
                    .after(main_opaque_pass_3d)
                    .before(main_transparent_pass_3d)
                    .in_set(CaptureSystems::Draw),
                hide_front
                    .run_if(any_front.or_else(any_shaded))
                    .after(main_opaque_pass_3d)
                    .before(main_transparent_pass_3d),
                (show_front.run_if(any_front), draw_captures::<true>, draw_front.run_if(any_front))
                    .chain()
                    .after(main_transparent_pass_3d)
                    // The resolve draws over all other transparent items.
                    .before(oit_resolve)
                    .in_set(CaptureSystems::DrawLate),
            )
                .in_set(Core3dSystems::MainPass),
        );
}

/// Adds the shaders of the passes that use Bevy's pipeline cache; `None` if the app has no shader assets.
fn add_shaders(app: &mut App) -> Option<CaptureShaders> {
    let mut shaders = app.world_mut().get_resource_mut::<Assets<Shader>>()?;
    let mut add = |source: &'static str, path: &str| shaders.add(Shader::from_wgsl(source, path));
    Some(CaptureShaders {
        composite: add(include_str!("../../../shaders/composite.wgsl"), "bevy_gs4d/shaders/composite.wgsl"),
        write_depth: add(include_str!("../../../shaders/write_depth.wgsl"), "bevy_gs4d/shaders/write_depth.wgsl"),
        write_motion: add(include_str!("../../../shaders/write_motion.wgsl"), "bevy_gs4d/shaders/write_motion.wgsl"),
        _srgb: add(include_str!("../../../shaders/shared/srgb.wgsl"), "bevy_gs4d/shaders/shared/srgb.wgsl"),
    })
}
