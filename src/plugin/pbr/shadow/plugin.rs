//! Set-up of shadows that captures cast: adds the systems to their schedules.
//!
//! In: an app in which captures are drawn and lights have shadow maps. Out: captures that cast shadows.

use super::draw::{cast_cascades, cast_shared};
use super::extract::{ExtractedCasters, any_caster, any_casts, extract_casters};
use super::light_views::{LightViews, any_light_view};
use super::prepare::prepare_light_views;
use crate::plugin::render::captures::back_off::BackOff;
use crate::plugin::render::{ExtractedCaptures, extract_captures};
use bevy::app::App;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemCondition};
use bevy::pbr::{LATE_SHADOW_PASS, PbrPlugin, per_view_shadow_pass, shared_shadow_pass};
use bevy::render::view::RetainedViewEntity;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderSystems};

/// Lets captures cast shadows: adds the systems and resources, if there is a render world in which meshes are lit.
pub(in crate::plugin::pbr) fn build(app: &mut App) {
    let is_lit = app.is_plugin_added::<PbrPlugin>();
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    if !is_lit || !render_app.world().contains_resource::<ExtractedCaptures>() {
        return;
    }
    render_app
        .init_resource::<ExtractedCasters>()
        .init_gpu_resource::<LightViews>()
        .init_gpu_resource::<BackOff<RetainedViewEntity>>()
        .add_systems(ExtractSchedule, extract_casters.run_if(any_casts.or_else(any_caster)).after(extract_captures))
        .add_systems(
            Render,
            prepare_light_views.run_if(any_caster.or_else(any_light_view)).in_set(RenderSystems::PrepareBindGroups),
        )
        .add_systems(
            Core3d,
            (
                cast_cascades.after(per_view_shadow_pass::<LATE_SHADOW_PASS>),
                cast_shared.after(shared_shadow_pass::<LATE_SHADOW_PASS>),
            )
                .distributive_run_if(any_light_view)
                .before(Core3dSystems::MainPass),
        );
}
