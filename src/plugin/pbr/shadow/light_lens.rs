//! Lens of a light: converts the view of a shadow map to the renderer's conventions.
//!
//! In: the projection and pose with which Bevy draws meshes into the map, and the bounds of captures. Out:
//! [`LightLens`], which creates [`View`]s of captures, moved away from the light by their bias.

use crate::plugin::render::CameraLens;
use crate::view::View;
use bevy::camera::primitives::Aabb;
use glam::{Affine3A, Mat4, UVec2, Vec3, Vec4};

/// The view of a shadow map.
pub(super) struct LightLens {
    lens: CameraLens,
    world_from_light: Affine3A,
    /// Whether the light's rays are parallel.
    parallel: bool,
    /// Conversion of the map's value `d` to depth, as in [`CameraLens::distance`].
    pub(super) distance: Vec4,
}

impl LightLens {
    /// Returns the lens of a light for captures with these bounds; `None` for a projection that no light of Bevy has.
    ///
    /// With parallel rays, the near plane moves back to the first capture: like meshes, captures in front of Bevy's
    /// near plane also cast shadows.
    pub(super) fn of<'a>(
        clip_from_light: &Mat4,
        world_from_light: Affine3A,
        captures: impl Iterator<Item = (&'a Aabb, Affine3A)>,
    ) -> Option<Self> {
        let parallel = clip_from_light.row(3) == Vec4::W;
        if !parallel {
            let lens = CameraLens::of(clip_from_light)?;
            return Some(Self { lens, world_from_light, parallel, distance: lens.distance? });
        }
        let forward = -world_from_light.matrix3.z_axis;
        let first = |(bounds, placed): (&Aabb, Affine3A)| {
            let center = placed.transform_point3a(bounds.center) - world_from_light.translation;
            forward.dot(center) - bounds.relative_radius(&forward, &placed.matrix3)
        };
        let back = -captures.map(first).fold(0.0, f32::min);
        let [x, y, z, w] =
            [clip_from_light.x_axis, clip_from_light.y_axis, clip_from_light.z_axis, clip_from_light.w_axis];
        // The same rays with the near plane at depth 0: the depth value is 1 there and decreases by 1 per unit.
        let lens = CameraLens::of(&Mat4::from_cols(x, y, Vec4::Z, Vec4::new(w.x, w.y, 1.0, 1.0)))?;
        // d = w.z − z.z (depth − back).
        let distance = Vec4::new(w.z + z.z * back, -1.0, z.z, 0.0);
        let world_from_light = world_from_light * Affine3A::from_translation(Vec3::Z * back);
        Some(Self { lens, world_from_light, parallel, distance })
    }

    /// Returns the view of a capture that is moved away from the light by the distance `bias`, world units; a bias that
    /// is negative or not finite counts as 0. Its outline on the map does not change. `size` in pixels, `time` in the
    /// capture's unit. `None` if the transforms flatten the capture or are not finite.
    pub(super) fn view(
        &self,
        size: UVec2,
        time: f32,
        bounds: &Aabb,
        world_from_capture: Affine3A,
        bias: f32,
    ) -> Option<View> {
        let by = if bias.is_finite() { bias.max(0.0) } else { 0.0 };
        let push = if self.parallel {
            Affine3A::from_translation((-self.world_from_light.matrix3.z_axis * by).into())
        } else {
            // Scaling about the light moves the capture away and keeps its outline.
            let light = Vec3::from(self.world_from_light.translation);
            let distance = Vec3::from(world_from_capture.transform_point3a(bounds.center)).distance(light);
            let scale = Vec3::splat(1.0 + by / distance.max(by).max(f32::MIN_POSITIVE));
            Affine3A::from_translation(light) * Affine3A::from_scale(scale) * Affine3A::from_translation(-light)
        };
        self.lens.view(size, time, self.world_from_light, push * world_from_capture)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{EulerRot, Quat, Vec2};

    const SIZE: UVec2 = UVec2::new(64, 64);

    /// Returns a box of 1 x 2 x 3 units around the origin.
    fn bounds() -> Aabb {
        Aabb::from_min_max(Vec3::new(-0.5, -1.0, -1.5), Vec3::new(0.5, 1.0, 1.5))
    }

    /// Returns the projection of a cascade as Bevy builds it: 8 units wide, 10 deep.
    fn cascade() -> Mat4 {
        let (side, deep) = (2.0 / 8.0, 1.0 / 10.0);
        Mat4::from_cols(Vec4::X * side, Vec4::Y * side, Vec4::Z * deep, Vec4::new(0.0, 0.0, 1.0, 1.0))
    }

    fn pose(eye: Vec3) -> Affine3A {
        Affine3A::from_rotation_translation(Quat::from_euler(EulerRot::YXZ, 0.4, -0.9, 0.2), eye)
    }

    /// Returns normalized device coordinates with y down, and the depth value written to the map.
    fn drawn(lens: &LightLens, view: &View, point: Vec3) -> (Vec2, f32) {
        let depth = view.world_to_camera.transform_point3(point).z;
        let [x, y] = view.clip_rows();
        let divisor = if view.orthographic { 1.0 } else { depth };
        let place = Vec2::new(x.dot(point.extend(1.0)), y.dot(point.extend(1.0))) / divisor;
        let d = lens.distance;
        (place, (d.x - d.z * depth) / (d.w * depth - d.y))
    }

    fn drawn_by_bevy(clip_from_light: Mat4, light: Affine3A, point: Vec3) -> (Vec2, f32) {
        let clip = clip_from_light * Mat4::from(light.inverse()) * point.extend(1.0);
        (Vec2::new(clip.x, -clip.y) / clip.w, clip.z / clip.w)
    }

    fn lens(clip_from_light: &Mat4, light: Affine3A, placed: Affine3A) -> LightLens {
        LightLens::of(clip_from_light, light, [(&bounds(), placed)].into_iter()).expect("a light of Bevy")
    }

    #[test]
    fn captures_have_the_positions_and_depths_of_meshes() {
        let placed = Affine3A::from_rotation_translation(Quat::from_rotation_x(0.7), Vec3::new(0.3, -0.2, 0.1));
        let spot = Mat4::perspective_infinite_reverse_rh(1.2, 1.0, 0.1);
        let forward = -pose(Vec3::ZERO).matrix3.z_axis;
        let cases = [("spot", spot, 6.0), ("cascade", cascade(), 4.0), ("cascade behind it", cascade(), -5.0)];
        for (name, projection, away) in cases {
            let light = pose(Vec3::from(forward * -away));
            let lens = lens(&projection, light, placed);
            let view = lens.view(SIZE, 0.0, &bounds(), placed, 0.0).expect("not flat");
            for corner in [bounds().min(), bounds().max()] {
                let point = Vec3::from(corner);
                let (place, depth) = drawn(&lens, &view, point);
                let (expected, deep) = drawn_by_bevy(projection, light, placed.transform_point3(point));
                assert!(place.abs_diff_eq(expected, 1e-4), "{name}: {point} is at {place}, not {expected}");
                assert!((depth - deep).abs() < 1e-5, "{name}: the depth value of {point} is {depth}, not {deep}");
                let distance = view.world_to_camera.transform_point3(point).z;
                assert!(distance >= view.near - 1e-4, "{name}: {point} is in front of the near plane, at {distance}");
            }
        }
    }

    #[test]
    fn a_bias_moves_the_capture_away_and_keeps_its_outline() {
        let spot = Mat4::perspective_infinite_reverse_rh(1.2, 1.0, 0.1);
        let forward = -pose(Vec3::ZERO).matrix3.z_axis;
        for (name, projection) in [("spot", spot), ("cascade", cascade())] {
            let light = pose(Vec3::from(forward * -6.0));
            let lens = lens(&projection, light, Affine3A::IDENTITY);
            let view = |bias| lens.view(SIZE, 0.0, &bounds(), Affine3A::IDENTITY, bias).expect("not flat");
            let [near, far, broken] = [view(0.0), view(0.4), view(f32::NAN)];
            let depth = |view: &View| view.world_to_camera.transform_point3(Vec3::ZERO).z;
            let pushed = depth(&far) - depth(&near);
            assert!((pushed - 0.4).abs() < 1e-4, "{name}: the center is moved by {pushed}");
            assert_eq!(near, broken, "{name}: a bias of NaN counts as 0");
            for corner in [bounds().min(), bounds().max()] {
                let [(before, _), (after, _)] = [&near, &far].map(|view| drawn(&lens, view, corner.into()));
                assert!(before.abs_diff_eq(after, 1e-4), "{name}: {corner} moved from {before} to {after} on the map");
            }
        }
    }

    #[test]
    fn unsupported_projections_have_no_light_lens() {
        let none = LightLens::of(&Mat4::NAN, pose(Vec3::ZERO), [].into_iter());
        assert!(none.is_none(), "a projection of NaN has no lens");
    }
}
