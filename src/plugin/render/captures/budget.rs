//! Budget: leaves out Gaussians that are small on the screen while captures take more time than the game gives them.
//!
//! In: [`CaptureBudget`], the GPU times of [`CaptureStatistics`], the time of the frame; for each capture in a view,
//! its [`Importances`] and its place. Out: the [`Thinning`] of each capture in each view, which changes slowly.

use super::steering::Steering;
use crate::plugin::render::statistics::CaptureStatistics;
use crate::scene::{Bounds, Importances, RuntimeScene};
use crate::view::{Thinning, View};
use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Res, ResMut};
use bevy::log::debug_span;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::render::Extract;
use bevy::time::{Real, Time};
use glam::{Mat3, Vec2, Vec3};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The time that captures may take in a frame, all captures and cameras together: a resource.
///
/// While they take longer, the Gaussians that matter least to the picture are left out, in all views: those that are
/// small on the screen or faint, so that far captures become coarser first. Those that are left grow and become more
/// opaque, to fill the gaps. The limit moves slowly and Gaussians fade, so that nothing flickers; when there is time
/// again, all of them return. While frames are short enough, pictures are those without a budget, bit for bit.
///
/// [`CaptureSettings::priority`](crate::plugin::render::CaptureSettings::priority) keeps the detail of one capture.
/// [Levels of detail](crate::plugin::render::CaptureDetail) are chosen independently, by size. Shadows of captures are
/// thinned too, but their time is not part of [`gpu_time`](Self::gpu_time).
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use std::time::Duration;
///
/// fn setup(mut commands: Commands) {
///     // Four milliseconds of the GPU, on a fast one and on a slow one.
///     let gpu_time = Some(Duration::from_millis(4));
///     commands.insert_resource(CaptureBudget { gpu_time, ..default() });
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::render"]
pub struct CaptureBudget {
    /// GPU time of the captures of a frame, summed over all cameras. It is measured, also while
    /// [`CaptureStatistics::measure`] is off; on a GPU without timestamps it has no effect. Default: `None`, no limit.
    pub gpu_time: Option<Duration>,
    /// Time from a frame to the next, of the whole game, for GPUs without timestamps. With vertical synchronization,
    /// choose a tenth more than the time between two refreshes: a frame never takes less than that. Frames that the app
    /// delays on purpose count as well, such as those of Bevy's reactive update mode. If both times are given, both are
    /// kept. Default: `None`, no limit.
    pub frame_time: Option<Duration>,
    /// The smallest share of the Gaussians of a capture, those of all times, that is drawn whole, from 0 to 1, even if
    /// the time is exceeded; at least one of 4,096. Default: 1/64.
    pub least_share: f32,
}

impl Default for CaptureBudget {
    fn default() -> Self {
        Self { gpu_time: None, frame_time: None, least_share: 1.0 / 64.0 }
    }
}

impl CaptureBudget {
    /// Returns whether there is a limit.
    fn is_limited(&self) -> bool {
        self.gpu_time.is_some() || self.frame_time.is_some()
    }
}

/// Smaller priorities count as this one.
const LEAST_PRIORITY: f32 = 1e-3;

/// The size on the screen below which Gaussians are left out, for all views.
#[derive(Resource, Default)]
pub(crate) struct CaptureCut {
    steering: Steering,
    /// Whether there was a budget in the previous frame.
    was_limited: bool,
    /// Time of the newest frame of the game, seconds.
    frame_seconds: f32,
    least_share: f32,
    /// Whether any capture that a camera sees could be drawn with fewer Gaussians in this frame.
    can_fall: AtomicBool,
}

impl CaptureCut {
    /// Returns the Gaussians of a capture that are drawn in a view of a camera, at this priority.
    pub(in crate::plugin::render) fn seen(&self, view: &View, thinned: &ThinnedCapture<'_>, priority: f32) -> Thinning {
        let [wanted, most] = self.least(view, thinned, priority);
        if wanted < most {
            self.can_fall.store(true, Ordering::Relaxed);
        }
        self.thinning(view, thinned, priority)
    }

    /// Returns the Gaussians of a capture that are drawn in a view whose time is not measured, such as that of a light.
    pub(crate) fn thinning(&self, view: &View, thinned: &ThinnedCapture<'_>, priority: f32) -> Thinning {
        let [wanted, most] = self.least(view, thinned, priority);
        let least = wanted.min(most);
        thinned.importances.thinning(least)
    }

    /// Returns the least importance that is drawn by the size on the screen, and that of the smallest share.
    fn least(&self, view: &View, thinned: &ThinnedCapture<'_>, priority: f32) -> [f32; 2] {
        if priority == f32::INFINITY {
            return [0.0; 2];
        }
        let pixels = self.steering.pixels();
        // A priority that is negative or not a number is the smallest.
        let size = pixels_per_unit(view, thinned.core) * priority.max(LEAST_PRIORITY);
        let wanted = if pixels == 0.0 { 0.0 } else { pixels / size };
        [wanted, thinned.importances.least_of(self.least_share)]
    }
}

/// What [`CaptureCut::thinning`] needs to know of a capture.
pub(crate) struct ThinnedCapture<'a> {
    /// Of the level of detail that is drawn.
    pub(in crate::plugin::render) importances: &'a Importances,
    /// The box around most of its Gaussians, capture space; `None` if it is not known.
    pub(in crate::plugin::render) core: Option<Bounds>,
}

/// Most Gaussians in the sample of [`core_of`].
const SAMPLE: usize = 4096;

/// Returns the box around the middle nine tenths of the means of a capture, of Gaussians at even steps through it:
/// strays do not count. `None` if it is empty.
pub(super) fn core_of(scene: &RuntimeScene) -> Option<Bounds> {
    let count = scene.len().min(SAMPLE);
    let of_sample = |step: usize| scene.gaussian((step as u64 * scene.len() as u64 / count as u64) as usize);
    Bounds::core((0..count).map(of_sample))
}

/// Returns how many pixels a unit of the capture has in a view, at a typical depth.
fn pixels_per_unit(view: &View, core: Option<Bounds>) -> f32 {
    let scale = Mat3::from_mat4(view.world_to_camera).determinant().abs().cbrt();
    let focal = 0.5 * view.size.as_vec2() * Vec2::new(view.projection.x, view.projection.y).abs();
    let focal = (focal.x * focal.y).sqrt() * scale;
    if view.orthographic {
        return focal;
    }
    // A camera inside the capture sees most of it at the distance of its core.
    let (center, radius) = core.map_or((Vec3::ZERO, 1.0), |core| (core.center(), core.radius()));
    focal / view.world_to_camera.transform_point3(center).length().hypot(radius * scale)
}

/// Copies the resource and the time of the frame to the render world.
pub(in crate::plugin::render) fn extract_budget(
    mut extracted: ResMut<CaptureBudget>,
    mut cut: ResMut<CaptureCut>,
    budget: Extract<Option<Res<CaptureBudget>>>,
    time: Extract<Option<Res<Time<Real>>>>,
) {
    *extracted = budget.as_deref().copied().unwrap_or_default();
    cut.frame_seconds = time.as_ref().map_or(0.0, |time| time.delta_secs());
}

/// Returns whether there is a budget, or was one in the previous frame.
pub(in crate::plugin::render) fn any_budget(budget: Res<CaptureBudget>, cut: Res<CaptureCut>) -> bool {
    budget.is_limited() || cut.was_limited
}

/// Changes the size below which Gaussians are left out.
pub(in crate::plugin::render) fn steer_cut(
    budget: Res<CaptureBudget>,
    statistics: Res<CaptureStatistics>,
    mut cut: ResMut<CaptureCut>,
) {
    let _span = debug_span!("gs4d/budget").entered();
    statistics.measure_for_budget(budget.gpu_time.is_some());
    let is_least = !std::mem::take(cut.can_fall.get_mut());
    cut.least_share = budget.least_share;
    cut.was_limited = budget.is_limited();
    if cut.was_limited {
        let over = |wanted: Option<Duration>, seconds: f32| {
            wanted.filter(|_| seconds > 0.0).map(|wanted| seconds / wanted.as_secs_f32().max(1e-6))
        };
        let gpu = over(budget.gpu_time, statistics.gpu_seconds());
        let frame = over(budget.frame_time, cut.frame_seconds);
        cut.steering.steer(gpu.into_iter().chain(frame).reduce(f32::max), is_least);
    } else {
        cut.steering = Steering::default();
    }
    statistics.set_cut(cut.steering.pixels());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::view::{Camera, RasterFov};
    use glam::UVec2;

    /// Returns a cut at a size in pixels.
    fn cut(pixels: f32) -> CaptureCut {
        let mut cut = CaptureCut { least_share: 0.1, ..CaptureCut::default() };
        while cut.steering.pixels() < pixels {
            cut.steering.steer(Some(2.0), false);
        }
        cut
    }

    fn view(distance: f32) -> View {
        let camera = Camera::look_at(Vec3::X * distance, Vec3::ZERO, Vec3::Z, 0.8, UVec2::new(640, 480));
        camera.view(0.0, RasterFov::default())
    }

    #[test]
    fn far_captures_lose_gaussians_first_and_keep_their_smallest_share() {
        let scene = synthesize(&SynthSettings { count: 3000, ..SynthSettings::default() });
        let importances = Importances::of(&scene.into_runtime().expect("it can be drawn"));
        let core = Some(Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) });
        let thinned = ThinnedCapture { importances: &importances, core };
        assert!(CaptureCut::default().thinning(&view(5.0), &thinned, 1.0).is_none(), "all Gaussians without a cut");
        let cut = cut(0.5);
        let share = |distance: f32, priority: f32| {
            let thinning = cut.thinning(&view(distance), &thinned, priority);
            if thinning.is_none() { 1.0 } else { importances.share_above(thinning.least) }
        };
        let shares = [4.0, 8.0, 16.0, 1e4].map(|distance| share(distance, 1.0));
        assert!(shares.is_sorted_by(|near, far| near > far), "fewer Gaussians farther away: {shares:?}");
        let smallest = importances.share_above(importances.least_of(0.1));
        assert!((0.1..0.5).contains(&smallest), "a tenth of the Gaussians whole, others faint: {smallest}");
        assert_eq!(shares[3], smallest, "the smallest share far away");
        assert!((share(8.0, 2.0) / shares[0] - 1.0).abs() < 0.2, "twice the priority is half the distance");
        assert_eq!(share(1e4, f32::INFINITY), 1.0, "an infinite priority");
        for broken in [0.0, -1.0, f32::NAN] {
            assert_eq!(share(4.0, broken), smallest, "the smallest share at a priority of {broken}");
        }
    }

    #[test]
    fn whether_a_capture_can_be_drawn_with_less_is_known() {
        let importances = Importances::default();
        let thinned = ThinnedCapture { importances: &importances, core: None };
        let mut cut = cut(0.5);
        cut.seen(&view(4.0), &thinned, 1.0);
        assert!(!*cut.can_fall.get_mut(), "an empty capture has no Gaussians to leave out");
        let scene = synthesize(&SynthSettings { count: 300, ..SynthSettings::default() });
        let importances = Importances::of(&scene.into_runtime().expect("it can be drawn"));
        let thinned = ThinnedCapture { importances: &importances, core: None };
        cut.seen(&view(0.5), &thinned, f32::INFINITY);
        cut.seen(&view(1e5), &thinned, 1.0);
        cut.thinning(&view(0.5), &thinned, 1.0);
        assert!(!*cut.can_fall.get_mut(), "one of infinite priority, one at its smallest share, one in a shadow");
        cut.seen(&view(0.5), &thinned, 1.0);
        assert!(*cut.can_fall.get_mut(), "a near capture has");
    }

    #[test]
    fn strays_do_not_change_the_pixels_of_a_unit() {
        let scene = synthesize(&SynthSettings { count: 300, ..SynthSettings::default() });
        let mut scene = scene.into_runtime().expect("it can be drawn");
        let pixels = |scene: &RuntimeScene| pixels_per_unit(&view(5.0), core_of(scene));
        let before = pixels(&scene);
        scene.form.as_sliced_mut().expect("sliced").gaussians[7].mean = [1e4; 3];
        let after = pixels(&scene);
        assert!((after / before - 1.0).abs() < 0.05, "{before} pixels, and {after} with a stray Gaussian");
        let empty = RuntimeScene::sliced(Vec::new(), Harmonics::default());
        assert_eq!(core_of(&empty), None, "an empty capture has no core");
    }

    #[test]
    fn a_unit_has_more_pixels_near_the_camera() {
        let bounds = Some(Bounds { min: Vec3::splat(-0.1), max: Vec3::splat(0.1) });
        let [near, far] = [5.0, 10.0].map(|distance| pixels_per_unit(&view(distance), bounds));
        let expected = 640.0 / 2.0 / 0.4f32.tan() / 10.0;
        assert!((far / expected - 1.0).abs() < 0.01, "{far} pixels at a distance of 10, expected {expected}");
        assert!((near / far - 2.0).abs() < 0.01, "twice as many at half the distance: {near}");
        assert!(pixels_per_unit(&view(1e-3), bounds).is_finite(), "in the middle of the capture");
    }
}
