//! Placing: the mesh of each contact shadow, under its capture.
//!
//! In: captures with a [`CaptureContactShadow`], their bounds in world space. Out: a child of each with a mesh, placed anew in every frame
//! and hidden while its capture is not drawn; and none of those without.

use super::component::{CaptureContactShadow, Ellipse};
use super::gradient::gradient;
use super::material::{BlendedEarly, ContactShadowMaterial};
use crate::plugin::asset::CaptureState;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::playback::ClipFade;
use crate::plugin::render::CaptureSettings;
use bevy::asset::{Assets, Handle};
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{RenderLayers, Visibility};
use bevy::color::Color;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::{ChildOf, Children};
use bevy::ecs::query::{With, Without};
use bevy::ecs::system::{Commands, Local, Query, ResMut};
use bevy::image::Image;
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::material::{AlphaMode, OpaqueRendererMethod};
use bevy::math::primitives::Plane3d;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::{GlobalTransform, Transform};
use glam::{Affine3A, Vec2, Vec3};

/// On the entity that draws a contact shadow.
#[derive(Component, Default)]
pub(super) struct ContactShadowMesh {
    /// Strength and softness that its material has been given.
    drawn: Option<[f32; 2]>,
}

/// Spawns the meshes of new contact shadows and despawns those of removed ones.
pub(super) fn spawn_contact_shadows(
    captures: Query<(Entity, Option<&Children>), (With<CaptureContactShadow>, With<GaussianCapture3d>)>,
    shadows: Query<(Entity, &ChildOf), With<ContactShadowMesh>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<ContactShadowMaterial>>,
    mut disk: Local<Option<Handle<Mesh>>>,
    mut commands: Commands,
) {
    for (shadow, capture) in &shadows {
        if !captures.contains(capture.parent()) {
            commands.entity(shadow).try_despawn();
        }
    }
    for (capture, children) in &captures {
        if children.is_some_and(|children| shadows.iter_many(children).next().is_some()) {
            continue;
        }
        let disk = disk.get_or_insert_with(|| meshes.add(Plane3d::new(Vec3::Y, Vec2::ONE)));
        let shadow = (
            ContactShadowMesh::default(),
            ChildOf(capture),
            Mesh3d(disk.clone()),
            MeshMaterial3d(materials.add(black())),
            Visibility::Hidden,
            Transform::default(),
            NotShadowCaster,
            NotShadowReceiver,
        );
        // The ground beneath it is what is meant by a click.
        #[cfg(feature = "picking")]
        let shadow = (shadow, bevy::picking::Pickable::IGNORE);
        commands.spawn(shadow);
    }
}

/// Returns the material of a shadow without its picture.
fn black() -> ContactShadowMaterial {
    let base = StandardMaterial {
        base_color: Color::BLACK,
        unlit: true,
        // What the shader does; the phase is chosen by the extension.
        alpha_mode: AlphaMode::Blend,
        opaque_render_method: OpaqueRendererMethod::Forward,
        ..StandardMaterial::default()
    };
    ContactShadowMaterial { base, extension: BlendedEarly {} }
}

type Capture = (
    &'static CaptureContactShadow,
    &'static CaptureState,
    &'static CaptureSettings,
    Option<&'static ClipFade>,
    &'static GlobalTransform,
    Option<&'static Aabb>,
    Option<&'static RenderLayers>,
);

type Shadow = (
    Entity,
    &'static ChildOf,
    &'static mut ContactShadowMesh,
    &'static mut GlobalTransform,
    &'static mut Visibility,
    &'static MeshMaterial3d<ContactShadowMaterial>,
    Option<&'static RenderLayers>,
);

/// Places the meshes beneath their captures, after everything that moves those. A mesh has its place in the world, whatever the transform
/// of its parent, so that it lies flat under a capture that is turned.
pub(super) fn place_contact_shadows(
    captures: Query<Capture, Without<ContactShadowMesh>>,
    mut shadows: Query<Shadow>,
    mut materials: ResMut<Assets<ContactShadowMaterial>>,
    mut images: ResMut<Assets<Image>>,
    mut commands: Commands,
) {
    for (entity, parent, mut mesh, mut place, mut visibility, material, shadow_layers) in &mut shadows {
        let Ok((settings, state, capture, fade, transform, bounds, layers)) = captures.get(parent.parent()) else {
            continue;
        };
        let opacity = capture.appearance(fade.copied().unwrap_or_default().0).opacity.min(1.0);
        if shadow_layers != layers {
            let mut entity = commands.entity(entity);
            match layers {
                Some(layers) => entity.try_insert(layers.clone()),
                None => entity.try_remove::<RenderLayers>(),
            };
        }
        let bounds = bounds.filter(|_| *state == CaptureState::Ready);
        let ellipse = bounds.and_then(|bounds| ellipse(settings, bounds, &transform.affine(), opacity));
        let shown = if ellipse.is_some() { Visibility::Inherited } else { Visibility::Hidden };
        visibility.set_if_neq(shown);
        let Some(ellipse) = ellipse else { continue };
        place.set_if_neq(GlobalTransform::from(ellipse.world_from_disk));
        let look = [ellipse.strength, settings.softness()];
        if mesh.drawn == Some(look) {
            continue;
        }
        let Some(mut material) = materials.get_mut(&material.0) else { continue };
        material.base.base_color = Color::srgba(0.0, 0.0, 0.0, ellipse.strength);
        if mesh.drawn.is_none_or(|[_, softness]| softness != look[1]) {
            material.base.base_color_texture = Some(images.add(gradient(look[1])));
        }
        mesh.drawn = Some(look);
    }
}

/// Returns the ellipse beneath a capture's bounds; `None` if nothing of it shows.
fn ellipse(
    settings: &CaptureContactShadow,
    bounds: &Aabb,
    world_from_capture: &Affine3A,
    opacity: f32,
) -> Option<Ellipse> {
    let center = world_from_capture.transform_point3a(bounds.center);
    let half_size = world_from_capture.matrix3.abs() * bounds.half_extents;
    let ellipse = settings.beneath(center.into(), half_size.into()).filter(|_| opacity > 0.0)?;
    Some(Ellipse { strength: ellipse.strength * opacity, ..ellipse })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn a_turned_capture_has_its_shadow_flat_on_the_ground() {
        // One unit wide, long and three high in its own space, where z is up.
        let bounds = Aabb::from_min_max(Vec3::new(-0.5, -0.5, 0.0), Vec3::new(0.5, 0.5, 3.0));
        let upright = Affine3A::from_rotation_translation(Quat::from_rotation_x(-FRAC_PI_2), Vec3::new(2.0, 0.0, 1.0));
        let settings = CaptureContactShadow { softness: 0.0, ..CaptureContactShadow::default() };
        let beneath = |opacity| ellipse(&settings, &bounds, &upright, opacity);
        let ellipse = beneath(1.0).expect("it stands on the ground");
        let [middle, edge] = [Vec3::ZERO, Vec3::X].map(|at| ellipse.world_from_disk.transform_point3(at));
        assert!(middle.abs_diff_eq(Vec3::new(2.0, 0.0, 1.0), 0.01), "it is beneath, not at {middle}");
        assert!(edge.abs_diff_eq(Vec3::new(2.5, 0.0, 1.0), 0.01), "and as wide as the capture, not up to {edge}");
        let half = beneath(0.5).expect("half of it shows");
        assert!((half.strength - 0.5 * ellipse.strength).abs() < 1e-6, "it is as transparent as the capture");
        assert_eq!(beneath(0.0), None, "and hidden with it");
    }
}
