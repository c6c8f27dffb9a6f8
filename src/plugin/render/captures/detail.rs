//! Detail: chooses the level of detail of each capture for each camera by its size on the screen.
//!
//! In: extracted captures and cameras, the levels of detail of uploaded captures, [`CaptureDetail`]. Out:
//! [`CaptureLevels`], the level of each capture for each camera. A level is kept while the size is near its limit,
//! which avoids flicker; cameras that see a capture at nearly the same size, such as two eyes, draw the same level.

use super::extract::ExtractedCaptures;
use super::upload::GpuGaussianCapture;
use crate::plugin::component::GaussianCapture3d;
use crate::scene::detail::pixels_across;
use crate::scene::{Bounds, Level};
use bevy::camera::{Camera3d, MainPassResolutionOverride};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::log::debug_span;
use bevy::platform::collections::HashMap;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::render::Extract;
use bevy::render::render_asset::RenderAssets;
use bevy::render::sync_world::{MainEntity, MainEntityHashMap};
use bevy::render::view::{ExtractedView, RenderVisibleEntities};
use glam::{Affine3A, Mat4, UVec2, Vec3, Vec4};

/// A coarser level is chosen at a size on the screen below this factor times its limit, and left at the limit itself.
const SLACK: f32 = 0.8;
/// Cameras draw the same level of a capture if its sizes on their screens have at most this ratio, as for two eyes.
const ALIKE: f32 = 1.1;
/// The same ratio for cameras that drew the same level in the previous frame: larger, so that levels do not flicker.
const STILL_ALIKE: f32 = 1.2;

/// The detail at which captures are drawn: a resource.
///
/// Captures with levels of detail (`gs4d detail`) are drawn with fewer Gaussians where they are small on the screen.
/// [`CaptureSettings::finest_level`](crate::plugin::render::CaptureSettings::finest_level) limits the detail of one
/// capture, [`CaptureBudget`](crate::plugin::render::CaptureBudget) the time of all of them.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// Counts every capture as half as large as it is.
/// fn coarser(mut detail: ResMut<CaptureDetail>) {
///     detail.bias = -1.0;
/// }
/// # bevy::ecs::system::assert_is_system(coarser);
/// ```
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::render"]
pub struct CaptureDetail {
    /// Bias on the size on the screen, in stops: at −1 captures count as half as large, so that coarser levels are
    /// drawn; at 1 as twice as large. Default: 0, as measured when the levels were made.
    pub bias: f32,
}

/// The level of each capture that has levels, for each camera that sees it. Level 0 is all Gaussians.
#[derive(Resource, Default)]
pub(in crate::plugin::render) struct CaptureLevels {
    /// Level, and whether the capture was seen this frame, by the camera's entity in the render world and the capture's
    /// entity in the main world.
    chosen: HashMap<(Entity, MainEntity), (usize, bool)>,
    /// Whether any camera draws all Gaussians of a capture.
    whole: MainEntityHashMap<bool>,
    /// The sights of this frame. The memory is kept from frame to frame.
    sights: Vec<Sight>,
}

impl CaptureLevels {
    /// Returns the level of a capture for a camera.
    pub(in crate::plugin::render) fn of(&self, camera: Entity, capture: MainEntity) -> usize {
        self.chosen.get(&(camera, capture)).map_or(0, |(level, _)| *level)
    }

    /// Returns whether cameras see a capture, but no camera draws all of its Gaussians.
    pub(in crate::plugin::render) fn is_coarse(&self, capture: &MainEntity) -> bool {
        self.whole.get(capture) == Some(&false)
    }
}

/// A capture with levels, seen by a camera.
#[derive(Clone, Copy)]
struct Sight {
    camera: Entity,
    capture: MainEntity,
    /// The capture's size on the screen, in pixels.
    pixels: f32,
    /// The level in the previous frame, if the capture was seen.
    before: Option<usize>,
}

impl Sight {
    /// Returns the largest size and the finest previous level among all cameras that see the capture at nearly this
    /// size: the input of [`choose`].
    fn together(&self, same_capture: &[Self]) -> (f32, Option<usize>) {
        let is_alike = |other: &&Self| {
            let ratio = if other.before == self.before && self.before.is_some() { STILL_ALIKE } else { ALIKE };
            other.pixels <= self.pixels * ratio && self.pixels <= other.pixels * ratio
        };
        let alike = same_capture.iter().filter(is_alike);
        let before = alike.clone().filter_map(|other| other.before).min();
        // NaN matches no other size and is kept.
        (alike.fold(self.pixels, |most, other| most.max(other.pixels)), before.or(self.before))
    }
}

/// Copies the resource to the render world; the default if it has been removed.
pub(in crate::plugin::render) fn extract_detail(
    mut extracted: ResMut<CaptureDetail>,
    detail: Extract<Option<Res<CaptureDetail>>>,
) {
    *extracted = detail.as_deref().copied().unwrap_or_default();
}

type CameraSize =
    (Entity, &'static ExtractedView, &'static RenderVisibleEntities, Option<&'static MainPassResolutionOverride>);

/// Returns whether any capture has levels, or had levels in the previous frame.
pub(in crate::plugin::render) fn any_levels(
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    levels: Res<CaptureLevels>,
) -> bool {
    !levels.chosen.is_empty() || captures.iter().any(|(_, capture)| capture.detail().is_some())
}

/// Chooses the levels of this frame.
pub(in crate::plugin::render) fn choose_levels(
    extracted: Res<ExtractedCaptures>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    detail: Res<CaptureDetail>,
    cameras: Query<CameraSize, With<Camera3d>>,
    mut levels: ResMut<CaptureLevels>,
) {
    let _span = debug_span!("gs4d/detail").entered();
    let levels = &mut *levels;
    levels.whole.clear();
    levels.sights.clear();
    levels.chosen.values_mut().for_each(|(_, seen)| *seen = false);
    let factor = detail.bias.exp2();
    for (camera, view, visible, resolution) in &cameras {
        let size = resolution.map_or(UVec2::new(view.viewport.z, view.viewport.w), |smaller| smaller.0);
        let eye = Vec3::from(view.world_from_view.affine().translation);
        let Some(visible) = visible.get::<GaussianCapture3d>() else { continue };
        for (_, &capture) in visible.iter_visible() {
            let Some(placed) = extracted.0.get(&capture) else { continue };
            let detail = captures.get(placed.asset).and_then(GpuGaussianCapture::detail);
            let Some((_, bounds)) = detail else { continue };
            let pixels = size_on_screen(&view.clip_from_view, eye, size, &placed.world_from_capture, bounds) * factor;
            let before = levels.chosen.get(&(camera, capture)).map(|(level, _)| *level);
            levels.sights.push(Sight { camera, capture, pixels, before });
        }
    }
    levels.sights.sort_unstable_by_key(|sight| sight.capture.id());
    for same in levels.sights.chunk_by(|a, b| a.capture == b.capture) {
        let capture = same[0].capture;
        let Some(placed) = extracted.0.get(&capture) else { continue };
        let Some((own, _)) = captures.get(placed.asset).and_then(GpuGaussianCapture::detail) else { continue };
        for sight in same {
            let (pixels, before) = sight.together(same);
            let level = choose(own, pixels, before).max(usize::from(placed.finest_level).min(own.len()));
            levels.chosen.insert((sight.camera, capture), (level, true));
            *levels.whole.entry(capture).or_insert(false) |= level == 0;
        }
    }
    levels.chosen.retain(|_, (_, seen)| *seen);
}

/// Returns the coarsest level that is accurate enough at a size on the screen. `before` is the previous level, which is
/// kept near its limit; it is `None` if the capture was not seen in the previous frame.
fn choose(levels: &[Level], pixels: f32, before: Option<usize>) -> usize {
    // NaN counts as larger than any limit.
    let fits = |level: usize, slack: f32| level == 0 || pixels <= levels[level - 1].pixels * slack;
    let coarsest = |slack: f32| (0..=levels.len()).rev().find(|&level| fits(level, slack)).unwrap_or(0);
    match before.filter(|&before| before <= levels.len() && fits(before, 1.0)) {
        Some(before) => coarsest(SLACK).max(before),
        None => coarsest(1.0),
    }
}

/// Returns the size on the screen, in pixels, of the sphere around the bounds of a capture.
fn size_on_screen(clip_from_view: &Mat4, eye: Vec3, size: UVec2, world_from_capture: &Affine3A, bounds: Bounds) -> f32 {
    let size = size.as_vec2();
    let focal = 0.5 * (clip_from_view.x_axis.x * size.x).max(clip_from_view.y_axis.y * size.y);
    let axes = world_from_capture.matrix3;
    let scale = axes.x_axis.length().max(axes.y_axis.length()).max(axes.z_axis.length());
    let (center, radius) = (world_from_capture.transform_point3(bounds.center()), bounds.radius() * scale);
    if clip_from_view.row(3) == Vec4::W {
        // Parallel rays: the size is the same at every distance.
        2.0 * focal * radius
    } else {
        pixels_across(radius, eye.distance(center), focal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::scene::RuntimeScene;
    use std::sync::Arc;

    fn levels(sizes: &[f32]) -> Vec<Level> {
        let scene = Arc::new(RuntimeScene::sliced(Vec::new(), Harmonics::default()));
        sizes.iter().map(|&pixels| Level { pixels, scene: scene.clone() }).collect()
    }

    #[test]
    fn the_coarsest_accurate_level_is_chosen() {
        let levels = levels(&[100.0, 40.0, 10.0]);
        for (pixels, expected) in [(5.0, 3), (10.0, 3), (11.0, 2), (90.0, 1), (101.0, 0), (f32::INFINITY, 0)] {
            assert_eq!(choose(&levels, pixels, None), expected, "the level at {pixels} pixels");
        }
        assert_eq!(choose(&levels, f32::NAN, None), 0, "all Gaussians are drawn at a size of NaN");
        assert_eq!(choose(&[], 1.0, None), 0, "a capture without levels is drawn whole");
    }

    #[test]
    fn a_coarser_level_is_chosen_well_below_its_limit_and_left_at_it() {
        let levels = levels(&[100.0, 40.0]);
        assert_eq!(choose(&levels, 41.0, Some(2)), 1, "a finer level is chosen at the limit");
        assert_eq!(choose(&levels, 39.0, Some(1)), 1, "no coarser level just below its limit");
        assert_eq!(choose(&levels, 31.0, Some(1)), 2, "a coarser level well below its limit");
        assert_eq!(choose(&levels, 39.0, Some(2)), 2, "the coarser level is kept just below its limit");
        assert_eq!(choose(&levels, 5.0, Some(0)), 2, "several levels coarser in one step");
        assert_eq!(choose(&levels, 500.0, Some(2)), 0, "several levels finer in one step");
        assert_eq!(choose(&levels, 5.0, Some(9)), 2, "a previous level that does not exist is ignored");
    }

    #[test]
    fn an_oscillation_of_five_percent_changes_the_level_at_most_once() {
        let levels = levels(&[100.0, 40.0, 10.0]);
        for middle in [8.0, 10.0, 12.5, 32.0, 40.0, 50.0, 80.0, 100.0, 125.0] {
            let mut level = choose(&levels, middle, None);
            let mut changes = 0;
            for turn in 0..40 {
                let pixels = middle * if turn % 2 == 0 { 1.05 } else { 0.95 };
                let next = choose(&levels, pixels, Some(level));
                changes += usize::from(next != level);
                level = next;
            }
            assert!(changes <= 1, "{changes} changes of the level around {middle} pixels, at most one expected");
        }
    }

    #[test]
    fn cameras_with_nearly_the_same_size_share_a_level() {
        let sight = |pixels, before| Sight {
            camera: Entity::PLACEHOLDER,
            capture: MainEntity::from(Entity::PLACEHOLDER),
            pixels,
            before,
        };
        let seen = [
            sight(99.0, Some(1)),
            sight(101.0, Some(0)),
            sight(50.0, Some(2)),
            sight(f32::INFINITY, None),
            sight(f32::NAN, Some(1)),
        ];
        let found = seen.map(|one| one.together(&seen));
        assert_eq!(found[0], (101.0, Some(0)), "the larger size and the finer level of two eyes");
        assert_eq!(found[0], found[1], "both eyes get the same level");
        assert_eq!(found[2], (50.0, Some(2)), "a camera farther away shares no level");
        assert_eq!(found[3], (f32::INFINITY, None), "a camera inside the capture shares no level");
        assert!(found[4].0.is_nan() && found[4].1 == Some(1), "NaN matches no other size: {:?}", found[4]);
    }

    #[test]
    fn cameras_that_move_apart_and_back_do_not_flicker() {
        let levels = levels(&[60.0]);
        let (mut near, mut chosen) = (51.5, [Some(1), Some(0)]);
        let mut changes = 0;
        for _ in 0..10 {
            let sights = [(47.0, chosen[0]), (near, chosen[1])].map(|(pixels, before)| Sight {
                camera: Entity::PLACEHOLDER,
                capture: MainEntity::from(Entity::PLACEHOLDER),
                pixels,
                before,
            });
            let now = sights.map(|sight| {
                let (pixels, before) = sight.together(&sights);
                Some(choose(&levels, pixels, before))
            });
            changes += usize::from(now != chosen);
            chosen = now;
            // Alternates across the ratio at which cameras share a level.
            near = 103.5 - near;
        }
        assert_eq!((chosen, changes), ([Some(0), Some(0)], 1), "both cameras change once, to the finer level");
    }

    #[test]
    fn size_on_screen_follows_scale_distance_and_lens() {
        let lens = Mat4::perspective_infinite_reverse_rh(0.8, 2.0, 0.1);
        let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
        let size = UVec2::new(400, 200);
        let seen =
            |scale: f32, eye: Vec3| size_on_screen(&lens, eye, size, &Affine3A::from_scale(Vec3::splat(scale)), bounds);
        let near = seen(1.0, Vec3::Z * 100.0);
        // 100 pixels are tan(0.4) of 100 units.
        assert!((near - 3f32.sqrt() * 2.0 / 0.4f32.tan()).abs() < 0.05, "{near} pixels at a distance of 100");
        assert!(
            (seen(2.0, Vec3::Z * 200.0) - near).abs() < 1e-3,
            "a capture twice as large and twice as far has the same size"
        );
        let flat = Mat4::orthographic_rh(-2.0, 2.0, -1.0, 1.0, 10.0, 0.1);
        let wide = size_on_screen(&flat, Vec3::Z * 9.0, size, &Affine3A::IDENTITY, bounds);
        assert!((wide - 200.0 * 3f32.sqrt()).abs() < 0.1, "100 pixels for each unit: {wide}");
    }
}
