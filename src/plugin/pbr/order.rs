//! Order: what a camera draws of lit meshes besides opaque and transparent ones.
//!
//! In: Bevy's transmissive phase and its wireframes. Out: [`OtherPasses`], and transmissive meshes after the captures behind them.

use crate::plugin::render::CaptureSystems;
use crate::plugin::render::order::{OtherPass, OtherPasses};
use bevy::app::App;
use bevy::camera::Camera3d;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::query::{Has, With};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::pbr::wireframe::Wireframe3d;
use bevy::pbr::{ExtractedAtmosphere, Transmissive3d, main_transmissive_pass_3d};
use bevy::render::render_phase::{ViewBinnedRenderPhases, ViewSortedRenderPhases, sort_phase_system};
use bevy::render::view::ExtractedView;
use bevy::render::{Render, RenderApp, RenderSystems};

/// Adds what the order of captures needs to the render world, if there is one.
pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<OtherPasses>()
        .configure_sets(Core3d, CaptureSystems::Draw.before(main_transmissive_pass_3d))
        .add_systems(
            Render,
            find_other_passes.in_set(RenderSystems::PhaseSort).after(sort_phase_system::<Transmissive3d>),
        );
}

/// Finds the transmissive meshes and wireframes that each camera draws.
fn find_other_passes(
    transmissive: Option<Res<ViewSortedRenderPhases<Transmissive3d>>>,
    wireframes: Option<Res<ViewBinnedRenderPhases<Wireframe3d>>>,
    cameras: Query<(&ExtractedView, Has<ExtractedAtmosphere>), With<Camera3d>>,
    mut others: ResMut<OtherPasses>,
) {
    others.0.clear();
    for (view, has_sky) in &cameras {
        let camera = view.retained_view_entity;
        let meshes = transmissive.as_ref().and_then(|phases| phases.get(&camera));
        let lines = wireframes.as_ref().and_then(|phases| phases.get(&camera));
        let refracting = meshes.and_then(|phase| phase.items.values().map(|item| item.distance).reduce(f32::max));
        let other = OtherPass {
            // Bevy draws the sky before or after transmissive meshes, and over what writes no depth.
            refracting: refracting.filter(|_| !has_sky),
            resolves_again: lines.is_some_and(|phase| !phase.is_empty()),
        };
        others.0.insert(camera, other);
    }
}
