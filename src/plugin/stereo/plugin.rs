//! The plugin of stereo: updates the positions and viewports of eyes.
//!
//! In: rigs, and the sizes of the eyes' targets. Out: the eyes' transforms, viewports and aspects, in the same frame.

use super::rig::{Eye, SideBySide, StereoRig};
use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::visibility::VisibilitySystems;
use bevy::camera::{Camera, CameraUpdateSystems, Projection, Viewport};
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::hierarchy::Children;
use bevy::ecs::query::With;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::schedule::common_conditions::any_with_component;
use bevy::ecs::system::Query;
use bevy::transform::TransformSystems;
use bevy::transform::components::Transform;
use glam::UVec2;

/// Keeps the eyes of every [`StereoRig`] at their distance, and [side-by-side](SideBySide) eyes in their halves of the
/// target. Part of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins); adding it again has no effect.
///
/// # Examples
///
/// ```no_run
/// use bevy::prelude::*;
/// use bevy_gs4d::stereo::StereoPlugin;
///
/// // Two eyes without captures.
/// App::new().add_plugins((DefaultPlugins, StereoPlugin)).run();
/// ```
#[derive(Debug, Default, Clone, Copy)]
pub struct StereoPlugin;

impl Plugin for StereoPlugin {
    fn build(&self, app: &mut App) {
        if app.is_plugin_added::<Self>() {
            return;
        }
        app.add_systems(
            PostUpdate,
            (
                place_eyes.run_if(any_with_component::<StereoRig>).before(TransformSystems::Propagate),
                fit_eyes
                    .run_if(any_with_component::<SideBySide>)
                    .after(CameraUpdateSystems)
                    .before(VisibilitySystems::UpdateFrusta),
            ),
        );
    }

    /// A second plugin has no effect.
    fn is_unique(&self) -> bool {
        false
    }
}

fn place_eyes(rigs: Query<(&StereoRig, &Children)>, mut eyes: Query<(&Eye, &mut Transform)>) {
    for (rig, children) in rigs.iter().filter(|(rig, _)| rig.ipd.is_finite()) {
        for &child in children {
            if let Ok((eye, mut transform)) = eyes.get_mut(child) {
                transform.set_if_neq(Transform::from_xyz(eye.side() * rig.ipd / 2.0, 0.0, 0.0));
            }
        }
    }
}

/// Sets the viewports. Runs after Bevy has updated the target's size, and updates the projection of a changed viewport,
/// which Bevy would do one frame later.
fn fit_eyes(mut eyes: Query<(&Eye, &mut Camera, &mut Projection), With<SideBySide>>) {
    for (eye, mut camera, mut projection) in &mut eyes {
        let Some((corner, size)) = camera.physical_target_size().and_then(|target| half(*eye, target)) else {
            continue;
        };
        let fits = |viewport: &Viewport| viewport.physical_position == corner && viewport.physical_size == size;
        if camera.viewport.as_ref().is_some_and(fits) {
            continue;
        }
        camera.viewport = Some(Viewport { physical_position: corner, physical_size: size, ..Viewport::default() });
        let logical = camera.logical_viewport_size().filter(|logical| logical.min_element() > 0.0);
        if let Some(logical) = logical {
            projection.update(logical.x, logical.y);
            camera.computed.clip_from_view = projection.get_clip_from_view();
        }
    }
}

/// Returns corner and size of an eye's half, in pixels; `None` if the target is too small to have halves.
fn half(eye: Eye, target: UVec2) -> Option<(UVec2, UVec2)> {
    let size = UVec2::new(target.x / 2, target.y);
    let left = match eye {
        Eye::Left => 0,
        Eye::Right => target.x - size.x,
    };
    (size.min_element() > 0).then_some((UVec2::new(left, 0), size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::stereo::rig::{EyeTargets, Stereo, spawn_stereo};
    use bevy::camera::{RenderTarget, RenderTargetInfo};
    use bevy::transform::TransformPlugin;
    use bevy::transform::components::GlobalTransform;
    use glam::{Quat, Vec3};
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn halves_have_equal_sizes_and_do_not_overlap() {
        for (width, right) in [(200, 100), (201, 101), (2, 1)] {
            let halves = Eye::BOTH.map(|eye| half(eye, UVec2::new(width, 50)).expect("there are two halves"));
            let size = UVec2::new(width / 2, 50);
            assert_eq!(halves, [(UVec2::ZERO, size), (UVec2::new(right, 0), size)], "the halves of {width} columns");
        }
        assert_eq!(half(Eye::Right, UVec2::new(1, 50)), None, "one column has no halves");
        assert_eq!(half(Eye::Left, UVec2::ZERO), None, "an empty target has no halves");
    }

    fn spawn(app: &mut App, rig: StereoRig) -> Stereo {
        let targets = EyeTargets::SideBySide(RenderTarget::default());
        let stereo = spawn_stereo(&mut app.world_mut().commands(), rig, targets);
        app.world_mut().flush();
        stereo
    }

    #[test]
    fn eyes_are_half_the_distance_to_each_side_of_the_head() {
        let mut app = App::new();
        app.add_plugins((TransformPlugin, StereoPlugin));
        let stereo = spawn(&mut app, StereoRig { ipd: 0.5 });
        let turned = Transform::from_xyz(1.0, 2.0, 3.0).with_rotation(Quat::from_rotation_y(FRAC_PI_2));
        app.world_mut().entity_mut(stereo.head).insert(turned);
        let place = |app: &App, eye: usize| {
            app.world().get::<GlobalTransform>(stereo.eyes[eye]).expect("an eye has a place").translation()
        };
        app.update();
        // After a turn by 90 degrees to the left, the head's +x axis is the world's −z axis.
        assert!(place(&app, 0).abs_diff_eq(Vec3::new(1.0, 2.0, 3.25), 1e-6), "the left eye is at {}", place(&app, 0));
        assert!(place(&app, 1).abs_diff_eq(Vec3::new(1.0, 2.0, 2.75), 1e-6), "the right eye is at {}", place(&app, 1));
        for (ipd, expected) in [(0.1, 2.95), (f32::NAN, 2.95), (0.0, 3.0)] {
            app.world_mut().entity_mut(stereo.head).insert(StereoRig { ipd });
            app.update();
            assert!(
                (place(&app, 1).z - expected).abs() < 1e-6,
                "with a distance of {ipd} the right eye is at {}",
                place(&app, 1)
            );
        }
    }

    #[test]
    fn adding_the_plugin_twice_adds_its_systems_once() {
        let systems = |times| {
            let mut app = App::new();
            for _ in 0..times {
                app.add_plugins(StereoPlugin);
            }
            app.get_schedule(PostUpdate).map_or(0, |schedule| schedule.graph().systems.len())
        };
        assert_eq!(systems(2), systems(1), "the systems are added once");
    }

    #[test]
    fn halves_follow_the_size_of_their_target() {
        let mut app = App::new();
        app.add_plugins((TransformPlugin, StereoPlugin));
        let stereo = spawn(&mut app, StereoRig::default());
        for size in [UVec2::new(200, 100), UVec2::new(301, 50), UVec2::new(64, 400)] {
            for eye in stereo.eyes {
                let mut camera = app.world_mut().get_mut::<Camera>(eye).expect("an eye is a camera");
                // As Bevy sets it, in the same frame.
                camera.computed.target_info = Some(RenderTargetInfo { physical_size: size, scale_factor: 1.0 });
            }
            app.update();
            for (entity, eye) in stereo.eyes.into_iter().zip(Eye::BOTH) {
                let camera = app.world().get::<Camera>(entity).expect("an eye is a camera");
                let viewport = camera.viewport.as_ref().expect("half of the target");
                let found = (viewport.physical_position, viewport.physical_size);
                assert_eq!(Some(found), half(eye, size), "viewport of {eye:?} in {size}");
                let projection = app.world().get::<Projection>(entity).expect("an eye has a lens");
                let Projection::Perspective(lens) = projection else { panic!("the projection is a perspective") };
                assert_eq!(lens.aspect_ratio, found.1.x as f32 / found.1.y as f32, "aspect ratio of {eye:?} in {size}");
                assert_eq!(
                    camera.computed.clip_from_view,
                    projection.get_clip_from_view(),
                    "matrix of {eye:?} in {size}"
                );
            }
        }
    }
}
