//! Set-up of contact shadows: adds the systems to their schedules.
//!
//! In: an app in which captures are drawn. Out: the same app with contact shadows.

use super::draw::draw_contact_shadows;
use super::extract::{ExtractedContactShadows, any_contact_shadow, any_extracted, extract_contact_shadows};
use super::pipeline::{ContactShadowPipeline, ContactShadowShader};
use super::prepare::{ContactShadowViews, any_view, prepare_contact_shadows};
use crate::plugin::render::CaptureSystems;
use crate::plugin::render::targets::checked_pipelines::CheckedPipelines;
use bevy::app::App;
use bevy::asset::Assets;
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemCondition};
use bevy::pbr::main_transmissive_pass_3d;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderSystems};
use bevy::shader::Shader;

/// Draws contact shadows: adds the systems and resources, if there is a render world.
pub(in crate::plugin::pbr) fn build(app: &mut App) {
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    let Some(mut shaders) = app.world_mut().get_resource_mut::<Assets<Shader>>() else { return };
    let source = include_str!("../../../../shaders/pbr/contact_shadow.wgsl");
    let shader = shaders.add(Shader::from_wgsl(source, "bevy_gs4d/shaders/pbr/contact_shadow.wgsl"));
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .insert_resource(ContactShadowShader(shader))
        .init_resource::<ExtractedContactShadows>()
        // Created again after a lost device: these resources hold all GPU objects.
        .init_gpu_resource::<ContactShadowPipeline>()
        .init_gpu_resource::<CheckedPipelines<ContactShadowPipeline>>()
        .init_gpu_resource::<ContactShadowViews>()
        .add_systems(ExtractSchedule, extract_contact_shadows.run_if(any_contact_shadow.or_else(any_extracted)))
        .add_systems(
            Render,
            prepare_contact_shadows.run_if(any_extracted.or_else(any_view)).in_set(RenderSystems::PrepareResources),
        )
        .add_systems(
            Core3d,
            draw_contact_shadows
                .run_if(any_view)
                .after(main_opaque_pass_3d)
                .before(main_transmissive_pass_3d)
                .before(main_transparent_pass_3d)
                .before(CaptureSystems::Draw)
                .in_set(Core3dSystems::MainPass),
        );
}
