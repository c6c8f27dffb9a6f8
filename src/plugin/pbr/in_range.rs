//! In range: the views in which a capture with Bevy's `VisibilityRange` casts its shadows, which are those of a mesh.
//!
//! In (main world): what Bevy has found to be in range of each camera. Out: [`InRange`], by capture.

use bevy::camera::visibility::{VisibilityRange, VisibleEntityRanges};
use bevy::camera::{Camera, RenderTarget, ShadowLodOrigin};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{Or, With};
use bevy::ecs::system::{Query, Res, SystemParam};
use bevy::light::{PointLight, SpotLight, get_shadow_lod_origin};
use bevy::render::sync_world::MainEntity;

/// The cameras that have a capture in range; `None`: all. The placeholder among them stands for the views of lights
/// that all cameras share.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct InRange(Option<Vec<MainEntity>>);

impl InRange {
    /// Returns whether no view has the capture in range.
    pub(super) fn is_nowhere(&self) -> bool {
        self.0.as_ref().is_some_and(Vec::is_empty)
    }

    /// Returns whether a camera has the capture in range; for the placeholder, whether the views do that cameras share.
    pub(super) fn of(&self, camera: MainEntity) -> bool {
        self.0.as_ref().is_none_or(|cameras| cameras.contains(&camera))
    }
}

/// The ranges of all entities, and the cameras.
#[derive(SystemParam)]
pub(super) struct Ranges<'w, 's> {
    ranges: Query<'w, 's, (), With<VisibilityRange>>,
    found: Option<Res<'w, VisibleEntityRanges>>,
    cameras: Query<'w, 's, (Entity, &'static RenderTarget), With<Camera>>,
    origins: Query<'w, 's, Entity, With<ShadowLodOrigin>>,
    lights: Query<'w, 's, Entity, Or<(With<PointLight>, With<SpotLight>)>>,
}

impl Ranges<'_, '_> {
    /// Returns where a capture is in range.
    pub(super) fn of(&self, capture: Entity) -> InRange {
        let Some(found) = self.found.as_ref().filter(|_| self.ranges.contains(capture)) else { return InRange(None) };
        let is_near = |camera: &Entity| found.entity_is_in_range_of_view(capture, *camera);
        let cameras = self.cameras.iter().map(|(camera, _)| camera).filter(is_near).map(MainEntity::from);
        // Bevy measures from one of the entities for the views that all cameras share.
        let origin = get_shadow_lod_origin(
            self.cameras.transmute_lens_filtered_inner(),
            self.origins.transmute_lens_filtered_inner(),
            self.lights.transmute_lens_filtered_inner(),
        );
        let shared = origin.filter(is_near).map(|_| MainEntity::from(Entity::PLACEHOLDER));
        InRange(Some(cameras.chain(shared).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::camera::visibility::check_visibility_ranges;
    use bevy::ecs::system::RunSystemOnce;
    use bevy::ecs::world::World;
    use bevy::tasks::{ComputeTaskPool, TaskPool};
    use bevy::transform::components::GlobalTransform;

    #[test]
    fn a_range_holds_for_each_camera_and_from_one_of_them_for_shared_views() {
        ComputeTaskPool::get_or_init(TaskPool::new);
        let mut world = World::new();
        world.init_resource::<VisibleEntityRanges>();
        let [near, far] = [2.0, 20.0].map(|z| {
            let camera = (Camera::default(), RenderTarget::default(), GlobalTransform::from_xyz(0.0, 0.0, z));
            MainEntity::from(world.spawn(camera).id())
        });
        let capture = world.spawn((GlobalTransform::IDENTITY, VisibilityRange::abrupt(0.0, 9.0))).id();
        let always = world.spawn(GlobalTransform::IDENTITY).id();
        let shared = MainEntity::from(Entity::PLACEHOLDER);
        let found = |world: &mut World, capture: Entity| {
            world.run_system_once(check_visibility_ranges).expect("the world has the resource");
            let of = move |ranges: Ranges| ranges.of(capture);
            let range: InRange = world.run_system_once(of).expect("the system runs");
            ([near, far, shared].map(|camera| range.of(camera)), range.is_nowhere())
        };
        world.entity_mut(near.id()).insert(ShadowLodOrigin);
        assert_eq!(found(&mut world, capture), ([true, false, true], false), "the origin is the near camera");
        world.entity_mut(near.id()).remove::<ShadowLodOrigin>();
        world.entity_mut(far.id()).insert(ShadowLodOrigin);
        assert_eq!(found(&mut world, capture), ([true, false, false], false), "the origin is the far camera");
        world.entity_mut(capture).insert(GlobalTransform::from_xyz(0.0, 0.0, 99.0));
        assert_eq!(found(&mut world, capture), ([false; 3], true), "both cameras are too far away");
        assert_eq!(found(&mut world, always), ([true; 3], false), "an entity without a range is seen by all");
    }
}
