//! Depth readers: the cameras with effects that read depths after the main pass.
//!
//! In (main world): cameras with all their components. Out (render world): [`DepthReaders`], for which
//! [`DepthWrite::Auto`](crate::plugin::render::DepthWrite::Auto) writes depths.
//!
//! Most of these effects belong to crates that this crate does not depend on; their components are found by type path.

use crate::plugin::render::settings::DepthWrite;
use bevy::camera::Camera;
use bevy::core_pipeline::oit::OrderIndependentTransparencySettings;
use bevy::core_pipeline::prepass::MotionVectorPrepass;
use bevy::ecs::query::With;
use bevy::ecs::reflect::AppTypeRegistry;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Local, Query, Res, ResMut};
use bevy::ecs::world::EntityRef;
use bevy::render::Extract;
use bevy::render::sync_world::{MainEntity, MainEntityHashSet};
use std::any::TypeId;

/// Type paths of camera components whose effects read the depth buffer after the main pass. Effects that read motion
/// vectors and order-independent transparency are found by type.
const READERS: [&str; 2] = ["bevy_post_process::dof::DepthOfField", "bevy_light::volumetric::VolumetricFog"];

/// Cameras with an effect that reads depths after the main pass.
#[derive(Resource, Default)]
pub(in crate::plugin::render) struct DepthReaders(MainEntityHashSet);

impl DepthReaders {
    /// Returns the depth to write for a camera with this setting: never [`DepthWrite::Auto`].
    pub(in crate::plugin::render) fn resolve(&self, camera: &MainEntity, setting: DepthWrite) -> DepthWrite {
        match setting {
            DepthWrite::Auto if self.0.contains(camera) => DepthWrite::Expected,
            DepthWrite::Auto => DepthWrite::None,
            chosen @ (DepthWrite::None | DepthWrite::Expected | DepthWrite::Median) => chosen,
        }
    }
}

/// Finds the cameras with an effect that reads depths.
pub(in crate::plugin::render) fn extract_depth_readers(
    mut readers: ResMut<DepthReaders>,
    mut known: Local<[Option<TypeId>; READERS.len()]>,
    registry: Extract<Res<AppTypeRegistry>>,
    cameras: Extract<Query<EntityRef, With<Camera>>>,
) {
    if known.contains(&None) {
        // The type is not registered in a game without the effect.
        let registry = registry.read();
        for (id, path) in known.iter_mut().zip(READERS) {
            *id = registry.get_with_type_path(path).map(|found| found.type_id());
        }
    }
    let reads = |camera: &EntityRef<'_>| {
        camera.contains::<MotionVectorPrepass>()
            || camera.contains::<OrderIndependentTransparencySettings>()
            || known.iter().flatten().any(|id| camera.contains_type_id(*id))
    };
    readers.0.clear();
    readers.0.extend(cameras.iter().filter(reads).map(|camera| MainEntity::from(camera.id())));
}

#[cfg(all(test, feature = "viewer"))]
mod tests {
    use super::*;
    use bevy::light::VolumetricFog;
    use bevy::post_process::dof::DepthOfField;
    use bevy::reflect::TypePath;

    #[test]
    fn the_type_paths_of_depth_readers_are_those_of_bevy() {
        let paths = [DepthOfField::type_path(), VolumetricFog::type_path()];
        assert_eq!(READERS, paths, "Bevy's effects that read depths have these type paths");
    }
}
