//! Order: finds the transmissive meshes and wireframes that a camera draws.
//!
//! In: Bevy's transmissive phase and wireframes; meshes that have moved. Out: [`OtherPasses`], which places captures
//! before the transmissive meshes in front of them. Bevy 0.19 sorts a transparent mesh by its position when it came
//! into view, so this module also updates the positions of moved meshes.

use crate::plugin::component::GaussianCapture3d;
use crate::plugin::render::CaptureSystems;
use crate::plugin::render::views::order::{OtherPass, OtherPasses};
use bevy::app::{App, SubApp};
use bevy::camera::Camera3d;
use bevy::camera::primitives::Aabb;
use bevy::core_pipeline::core_3d::{Transparent3d, TransparentSortingInfo3d};
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::change_detection::{DetectChanges, Ref};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{Has, With};
use bevy::ecs::resource::Resource;
use bevy::ecs::schedule::{IntoScheduleConfigs, ScheduleConfigs, SystemCondition};
use bevy::ecs::system::{Local, Query, Res, ResMut, ScheduleSystem};
use bevy::mesh::Mesh3d;
use bevy::pbr::wireframe::Wireframe3d;
use bevy::pbr::{ExtractedAtmosphere, Transmissive3d, main_transmissive_pass_3d};
use bevy::render::Extract;
use bevy::render::render_phase::{ViewBinnedRenderPhases, ViewSortedRenderPhases, sort_phase_system};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ExtractedView;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderSystems};
use bevy::transform::components::GlobalTransform;
use glam::Vec3;

/// The meshes that have moved since the previous frame, with the centers of their bounds in world space. Empty while
/// there are no captures; all meshes in the first frame with captures.
#[derive(Resource, Default)]
struct MovedMeshes(Vec<(MainEntity, Vec3)>);

/// Adds the systems and resources of this module to the render world, if there is one.
pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<OtherPasses>()
        .init_resource::<MovedMeshes>()
        .add_systems(ExtractSchedule, extraction())
        .configure_sets(Core3d, CaptureSystems::Draw.before(main_transmissive_pass_3d))
        .add_systems(
            Render,
            update_centers.run_if(any_moved).after(RenderSystems::Queue).before(RenderSystems::PhaseSort),
        )
        .add_systems(
            Render,
            find_other_passes
                .run_if(any_other_pass)
                .in_set(RenderSystems::PhaseSort)
                .after(sort_phase_system::<Transmissive3d>),
        );
}

/// Returns whether the systems and resources of this module have been added.
pub(super) fn is_built(render_app: &SubApp) -> bool {
    render_app.world().contains_resource::<MovedMeshes>()
}

/// Returns the extraction of moved meshes, which is skipped without meshes and without moved meshes to clear.
fn extraction() -> ScheduleConfigs<ScheduleSystem> {
    extract_moved_meshes.run_if(any_mesh.or_else(any_moved))
}

/// Returns whether the main world has any mesh.
fn any_mesh(meshes: Extract<Query<(), With<Mesh3d>>>) -> bool {
    !meshes.is_empty()
}

fn extract_moved_meshes(
    mut moved: ResMut<MovedMeshes>,
    mut follows: Local<bool>,
    captures: Extract<Query<(), With<GaussianCapture3d>>>,
    meshes: Extract<Query<(Entity, Ref<GlobalTransform>, Option<&Aabb>), With<Mesh3d>>>,
) {
    moved.0.clear();
    let followed = std::mem::replace(&mut *follows, !captures.is_empty());
    if !*follows {
        return;
    }
    let stale = meshes.iter().filter(|(_, place, _)| !followed || place.is_changed());
    // A mesh that is never culled has no bounds.
    let center = |bounds: Option<&Aabb>| bounds.map_or(Vec3::ZERO, |bounds| bounds.center.into());
    moved.0.extend(stale.map(|(mesh, place, bounds)| (mesh.into(), place.transform_point(center(bounds)))));
}

fn any_moved(moved: Res<MovedMeshes>) -> bool {
    !moved.0.is_empty()
}

/// Writes the new positions of moved meshes to the sorted phases, which keep meshes from frame to frame.
fn update_centers(
    moved: Res<MovedMeshes>,
    mut transparent: ResMut<ViewSortedRenderPhases<Transparent3d>>,
    mut transmissive: Option<ResMut<ViewSortedRenderPhases<Transmissive3d>>>,
) {
    let update = |info: &mut TransparentSortingInfo3d, center: Vec3| {
        if let TransparentSortingInfo3d::Sorted { mesh_center, .. } = info {
            *mesh_center = center;
        }
    };
    for &(mesh, center) in &moved.0 {
        let key = (Entity::PLACEHOLDER, mesh);
        for phase in transparent.values_mut() {
            phase.items.get_mut(&key).into_iter().for_each(|item| update(&mut item.sorting_info, center));
        }
        for phase in transmissive.iter_mut().flat_map(|phases| phases.values_mut()) {
            phase.items.get_mut(&key).into_iter().for_each(|item| update(&mut item.sorting_info, center));
        }
    }
}

/// Returns whether any camera draws transmissive meshes or wireframes, or drew them in the previous frame.
fn any_other_pass(
    transmissive: Option<Res<ViewSortedRenderPhases<Transmissive3d>>>,
    wireframes: Option<Res<ViewBinnedRenderPhases<Wireframe3d>>>,
    others: Res<OtherPasses>,
) -> bool {
    let refracts = transmissive.is_some_and(|phases| phases.values().any(|phase| !phase.items.is_empty()));
    refracts || wireframes.is_some_and(|phases| phases.values().any(|phase| !phase.is_empty())) || !others.0.is_empty()
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
            // Bevy draws the sky before or after transmissive meshes, and over captures that write no depth.
            refracting: refracting.filter(|_| !has_sky),
            resolves_again: lines.is_some_and(|phase| !phase.is_empty()),
        };
        if other != OtherPass::default() {
            others.0.insert(camera, other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::ecs::schedule::Schedule;
    use bevy::ecs::world::World;
    use bevy::render::MainWorld;

    #[test]
    fn moved_meshes_are_extracted_while_there_are_captures() {
        let mut render = World::new();
        render.init_resource::<MainWorld>();
        render.init_resource::<MovedMeshes>();
        let mut schedule = Schedule::default();
        schedule.add_systems(extraction());
        // Extracts, and returns the x positions of the meshes that have moved.
        let mut moved = |render: &mut World| -> Vec<f32> {
            schedule.run(render);
            render.resource::<MovedMeshes>().0.iter().map(|(_, center)| center.x).collect()
        };
        let mut main = render.resource_mut::<MainWorld>();
        let place = |x| GlobalTransform::from_xyz(x, 0.0, 0.0);
        let meshes @ [_, last] = [1.0, 2.0].map(|x| main.spawn((Mesh3d::default(), Aabb::default(), place(x))).id());
        assert_eq!(moved(&mut render), [0.0; 0], "no mesh is extracted without captures");
        let capture = render.resource_mut::<MainWorld>().spawn(GaussianCapture3d::default()).id();
        assert_eq!(moved(&mut render), [1.0, 2.0], "all meshes are extracted with the first capture");
        assert_eq!(moved(&mut render), [0.0; 0], "unmoved meshes are extracted once");
        render.resource_mut::<MainWorld>().entity_mut(last).insert(place(3.0));
        assert_eq!(moved(&mut render), [3.0], "a moved mesh is extracted");
        render.resource_mut::<MainWorld>().despawn(capture);
        render.resource_mut::<MainWorld>().entity_mut(last).insert(place(4.0));
        assert_eq!(moved(&mut render), [0.0; 0], "no mesh is extracted after the last capture is despawned");
        render.resource_mut::<MainWorld>().spawn(GaussianCapture3d::default());
        assert_eq!(moved(&mut render), [1.0, 4.0], "all meshes are extracted again with the next capture");
        for mesh in meshes {
            render.resource_mut::<MainWorld>().despawn(mesh);
        }
        assert_eq!(moved(&mut render), [0.0; 0], "despawned meshes are not extracted");
    }
}
