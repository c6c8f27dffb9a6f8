//! The asset type: a scene ready to draw, shared.
//!
//! In: a [`RuntimeScene`]. Out: a [`GaussianCapture`], cheap to clone, with its bounds, the extent of its Gaussians,
//! its duration and its up direction.

use super::key_frames::KeyFrames;
use crate::gaussian::{Gaussian, Harmonics};
use crate::scene::{ActiveSets, Bounds, BoundsOverTime, Environment, Form, Level, RuntimeScene, TemporalFilter};
use bevy::asset::{Asset, RenderAssetUsages};
use bevy::reflect::TypePath;
use glam::{Quat, Vec3};
use std::sync::Arc;

/// A capture as an asset. Spawn it with [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// Clones share the scene.
///
/// # Examples
///
/// ```
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
///
/// let scene = synthesize(&SynthSettings { count: 100, duration_seconds: 4.0, ..SynthSettings::default() });
/// let capture = GaussianCapture::new(scene.into_runtime()?);
/// assert_eq!(capture.duration_seconds(), 4.0, "as long as the scene");
/// assert!(capture.bounds().is_some(), "its Gaussians are somewhere");
/// // `assets.add(capture)`, with `assets: ResMut<Assets<GaussianCapture>>`, makes it spawnable.
/// # Ok::<(), bevy_gs4d::gaussian::InvalidGaussian>(())
/// ```
#[derive(Asset, TypePath, Debug, Clone)]
#[type_path = "bevy_gs4d::asset"]
pub struct GaussianCapture {
    scene: Arc<RuntimeScene>,
    bounds: Option<Arc<BoundsOverTime>>,
    /// The typical extent of its Gaussians, capture units.
    extent: f32,
    usages: RenderAssetUsages,
    /// Whether the Gaussians have been moved to the render world.
    is_released: bool,
}

impl GaussianCapture {
    /// Creates a capture from a scene in memory, and computes its bounds over time from every Gaussian. A packed scene
    /// whose parts do not fit together ([`PackedScene::check`](crate::scene::PackedScene::check)) has no bounds, and
    /// cannot be drawn.
    pub fn new(scene: RuntimeScene) -> Self {
        let usages = RenderAssetUsages::default();
        let mut capture = Self { scene: Arc::new(scene), bounds: None, extent: 0.0, usages, is_released: false };
        if let Form::Packed(packed) = &capture.scene.form
            && packed.check().is_err()
        {
            return capture;
        }
        // A still shows its first moment only.
        let shown = [0.0, f32::INFINITY].map(|seconds| capture.time_at(seconds));
        let mut extents = Extents::of(capture.scene.len());
        let gaussians = capture.scene.iter().inspect(|gaussian| extents.add(gaussian));
        capture.bounds = BoundsOverTime::of(
            gaussians,
            shown,
            capture.scene.trained_with.marginal_cutoff,
            capture.scene.filter.as_ref(),
        )
        .map(Arc::new);
        capture.extent = extents.upper_quartile();
        capture
    }

    /// Returns the capture with other usages. With `RenderAssetUsages::RENDER_WORLD` alone, the Gaussians are dropped
    /// from memory once they are on the GPU. Such a capture plays as others do, but [`scene`](Self::scene) has no
    /// Gaussians then: it can be neither picked nor saved, and after a lost device it fails and must be loaded again.
    /// Default: both worlds. `MAIN_WORLD` alone counts as both.
    pub fn with_usages(self, usages: RenderAssetUsages) -> Self {
        Self { usages, ..self }
    }

    /// Returns whether the Gaussians have been dropped from memory, by the [usages](Self::with_usages) of the capture.
    pub fn is_released(&self) -> bool {
        self.is_released
    }

    /// Returns the usages of the capture, which is always extracted.
    pub(crate) fn usages(&self) -> RenderAssetUsages {
        self.usages | RenderAssetUsages::RENDER_WORLD
    }

    /// Drops the Gaussians from memory and returns the capture with them; `None` if they have been dropped before.
    pub(crate) fn release(&mut self) -> Option<Self> {
        if self.is_released {
            return None;
        }
        let released = Self { scene: Arc::new(outline(&self.scene)), is_released: true, ..self.clone() };
        Some(std::mem::replace(self, released))
    }

    /// Returns the scene. After the Gaussians have been [released](Self::is_released), it has only the settings and
    /// levels without Gaussians.
    pub fn scene(&self) -> &RuntimeScene {
        &self.scene
    }

    /// Returns a shared pointer to the scene.
    pub(crate) fn shared_scene(&self) -> Arc<RuntimeScene> {
        self.scene.clone()
    }

    /// Returns the box that encloses all Gaussians at all times, in capture space; `None` for an empty capture.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds.as_ref().map(|bounds| bounds.whole())
    }

    /// Returns the box that encloses the Gaussians drawn at `seconds` since the start, and up to a 32nd of the duration
    /// earlier and later, in capture space; `None` if no Gaussian is drawn then.
    pub fn bounds_at(&self, seconds: f32) -> Option<Bounds> {
        self.bounds.as_ref()?.at(self.time_at(seconds))
    }

    /// Returns the typical extent of the Gaussians, a standard deviation in capture space: the error of the depth of a
    /// pixel, since a splat has one depth. 0 for an empty capture.
    pub(crate) fn extent(&self) -> f32 {
        self.extent
    }

    /// Returns the duration of one pass at speed 1, in seconds; 0 for a still.
    pub fn duration_seconds(&self) -> f32 {
        let seconds = self.scene.playback.duration_seconds;
        if seconds.is_finite() { seconds.max(0.0) } else { 0.0 }
    }

    /// Returns the timestamp, in the capture's own unit of time, at `seconds` since its start. Seconds outside the
    /// capture are clamped; NaN counts as 0.
    pub fn time_at(&self, seconds: f32) -> f32 {
        let [first, last] = self.scene.trained_with.time_interval;
        let duration = self.duration_seconds();
        if duration == 0.0 {
            return first;
        }
        let fraction = if seconds.is_nan() { 0.0 } else { (seconds / duration).clamp(0.0, 1.0) };
        first + fraction * (last - first)
    }

    /// Returns the seconds since the start at the timestamp `time`, in the capture's own unit: the inverse of
    /// [`time_at`](Self::time_at), but not clamped. 0 for a still.
    pub fn seconds_at(&self, time: f32) -> f32 {
        let [first, last] = self.scene.trained_with.time_interval;
        if last == first { 0.0 } else { (time - first) / (last - first) * self.duration_seconds() }
    }

    /// Returns the key-frames of the capture's temporal filter; `None` without a filter, and for a still.
    pub fn key_frames(&self) -> Option<KeyFrames> {
        KeyFrames::new(self.scene.filter.as_ref()?.segments, self.duration_seconds())
    }

    /// Returns the shortest rotation that stands the capture upright in Bevy's world, where +Y is up.
    pub fn upright(&self) -> Quat {
        Quat::from_rotation_arc(self.scene.playback.up.vector(), Vec3::Y)
    }
}

/// Maximum number of Gaussians whose extents are compared.
const SAMPLES: usize = 4096;

/// The extents of evenly spaced Gaussians of a scene.
struct Extents {
    stride: usize,
    count: usize,
    /// Extent and opacity of each sample.
    samples: Vec<(f32, f32)>,
}

impl Extents {
    fn of(count: usize) -> Self {
        Self { stride: count.div_ceil(SAMPLES).max(1), count: 0, samples: Vec::new() }
    }

    /// Adds the next Gaussian of the scene. Gaussians that cannot be drawn are ignored.
    fn add(&mut self, gaussian: &Gaussian) {
        if self.count.is_multiple_of(self.stride) && gaussian.check().is_ok() {
            let [xx, _, _, yy, _, zz] = gaussian.covariance;
            let extent = Vec3::new(xx, yy, zz).max_element().max(0.0).sqrt();
            self.samples.push((extent, gaussian.opacity));
        }
        self.count += 1;
    }

    /// Returns the extent above three quarters of the samples, weighted by opacity. Small Gaussians are numerous but
    /// cover little of a picture; the few large Gaussians of a sky have no influence. 0 without Gaussians.
    fn upper_quartile(mut self) -> f32 {
        self.samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let below = 0.75 * self.samples.iter().map(|(_, opacity)| opacity).sum::<f32>();
        let mut sum = 0.0;
        let reaches = |(_, opacity): &&(f32, f32)| {
            sum += opacity;
            sum >= below
        };
        self.samples.iter().find(reaches).map_or(0.0, |(extent, _)| *extent)
    }
}

/// Returns a scene with everything that is needed to play it, without Gaussians.
fn outline(scene: &RuntimeScene) -> RuntimeScene {
    let filter = scene.filter.as_ref().map(|filter| {
        let sets = match filter.sets {
            ActiveSets::Bits(_) => ActiveSets::Bits(Vec::new()),
            ActiveSets::Intervals(_) => ActiveSets::Intervals(Vec::new()),
        };
        TemporalFilter { kind: filter.kind, segments: filter.segments, count: 0, sets }
    });
    let level = |level: &Level| Level { pixels: level.pixels, scene: Arc::new(outline(&level.scene)) };
    RuntimeScene {
        environment: scene.environment.as_ref().map(|_| Environment { width: 0, height: 0, texels: Vec::new() }),
        filter,
        trained_with: scene.trained_with.clone(),
        playback: scene.playback,
        levels: scene.levels.iter().map(level).collect(),
        sockets: scene.sockets.clone(),
        colliders: scene.colliders.clone(),
        sound: scene.sound.clone(),
        chunks: scene.chunks.clone(),
        ..RuntimeScene::sliced(Vec::new(), Harmonics::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::packed::RECORD_WORDS;
    use crate::scene::{PackedColors, PackedScene, PlaybackHints, TrainedWith, UpAxis};

    fn capture(time_interval: [f32; 2], duration_seconds: f32) -> GaussianCapture {
        with(Vec::new(), time_interval, duration_seconds)
    }

    fn with(gaussians: Vec<Gaussian>, time_interval: [f32; 2], duration_seconds: f32) -> GaussianCapture {
        GaussianCapture::new(RuntimeScene {
            trained_with: TrainedWith { time_interval, ..TrainedWith::default() },
            playback: PlaybackHints { up: UpAxis::PosZ, duration_seconds },
            ..RuntimeScene::sliced(gaussians, Harmonics::default())
        })
    }

    #[test]
    fn seconds_map_onto_the_time_interval() {
        let capture = capture([-0.5, 1.5], 4.0);
        assert_eq!(capture.time_at(0.0), -0.5, "0 s is the first timestamp");
        assert_eq!(capture.time_at(4.0), 1.5, "the duration is the last timestamp");
        assert_eq!(capture.time_at(9.0), 1.5, "times beyond the end are clamped to the end");
        assert_eq!(capture.time_at(f32::NAN), -0.5, "NaN counts as 0 s");
        assert_eq!(capture.seconds_at(capture.time_at(1.0)), 1.0, "seconds_at is the inverse of time_at");
    }

    #[test]
    fn a_still_stays_at_its_first_moment() {
        assert_eq!(capture([0.25, 1.0], 0.0).time_at(3.0), 0.25, "a duration of 0 shows the first timestamp");
        assert_eq!(capture([0.25, 1.0], f32::INFINITY).duration_seconds(), 0.0, "an infinite duration counts as 0");
    }

    #[test]
    fn bounds_follow_playback() {
        let runner = Gaussian {
            mean: [0.0; 3],
            mean_t: 0.0,
            velocity: [1.0, 0.0, 0.0],
            sigma_t: f32::INFINITY,
            covariance: [1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4],
            opacity: 0.5,
            padding: 0.0,
        };
        let empty = capture([0.0, 1.0], 1.0);
        let capture = with(vec![runner], [0.0, 8.0], 2.0);
        let x = |seconds| capture.bounds_at(seconds).expect("the Gaussian is active at all times").center().x;
        assert!(x(0.0) < 0.2 && x(2.0) > 7.8, "from {} to {} in two seconds", x(0.0), x(2.0));
        assert!(
            capture.bounds().is_some_and(|all| all.min.x < 0.0 && all.max.x > 8.0),
            "the bounds of all times enclose the whole path"
        );
        let still = with(vec![runner], [3.0, 8.0], 0.0);
        assert_eq!(still.bounds_at(1.0), still.bounds(), "the bounds of a still do not depend on time");
        assert!(
            still.bounds().is_some_and(|all| all.min.x > 2.9 && all.max.x < 3.1),
            "a still is bounded at its first moment"
        );
        assert_eq!(empty.bounds_at(0.0), None, "an empty capture has no bounds");
    }

    #[test]
    fn the_extent_is_the_upper_quartile_weighted_by_opacity() {
        let round = |extent: f32, opacity: f32| Gaussian {
            mean: [0.0; 3],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [extent * extent, 0.0, 0.0, 0.0, 0.0, 0.0],
            opacity,
            padding: 0.0,
        };
        let extent = |gaussians: Vec<Gaussian>| with(gaussians, [0.0, 1.0], 1.0).extent();
        assert_eq!(extent(Vec::new()), 0.0, "an empty capture has no extent");
        let mixed = |large: Gaussian| [[round(0.5, 0.5); 8], [large; 8]].concat();
        assert_eq!(extent(mixed(round(1.0, 0.5))), 1.0, "half of the Gaussians have an extent of 1");
        assert_eq!(extent(mixed(round(1.0, 0.01))), 0.5, "eight faint Gaussians count little");
        let broken = round(f32::NAN, 0.5);
        assert_eq!(extent(vec![broken, round(0.25, 0.5), broken]), 0.25, "invalid Gaussians are ignored");
        let large = extent((0..3 * SAMPLES).map(|index| round(index as f32, 0.5)).collect());
        let expected = 0.75 * 3.0 * SAMPLES as f32;
        assert!((large - expected).abs() < 8.0, "of many Gaussians some are compared: {large}, not {expected}");
    }

    #[test]
    fn an_inconsistent_packed_scene_has_no_bounds() {
        let packed = PackedScene {
            records: vec![[0; RECORD_WORDS]],
            ranges: Vec::new(),
            colors: PackedColors::Whole(Harmonics { coefficients: 1, values: vec![0.0; 3], ..Harmonics::default() }),
            layers: Vec::new(),
            runs: None,
        };
        let empty = RuntimeScene::sliced(Vec::new(), Harmonics::default());
        let scene = RuntimeScene { form: Form::Packed(packed), ..empty };
        assert_eq!(GaussianCapture::new(scene).bounds(), None, "a record without a range is not decoded");
    }

    #[test]
    fn upright_turns_the_up_axis_to_y() {
        let up = capture([0.0, 1.0], 1.0).upright() * Vec3::Z;
        assert!(up.abs_diff_eq(Vec3::Y, 1e-6), "+z of the capture points up, not to {up}");
    }

    #[test]
    fn a_released_capture_keeps_all_but_its_gaussians() {
        let gaussian = Gaussian {
            mean: [0.0; 3],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            opacity: 0.5,
            padding: 0.0,
        };
        let whole = with(vec![gaussian], [-0.5, 1.5], 4.0);
        let mut capture = whole.clone();
        let taken = capture.release().expect("the Gaussians are in memory");
        assert_eq!((taken.scene().len(), taken.is_released()), (1, false), "the returned capture has the Gaussian");
        assert_eq!((capture.scene().len(), capture.is_released()), (0, true), "the capture has no Gaussian");
        assert_eq!(capture.bounds(), whole.bounds(), "the bounds are kept");
        assert_eq!(capture.extent(), 1.0, "the extent is kept");
        assert_eq!(capture.time_at(1.0), whole.time_at(1.0), "the times are kept");
        assert_eq!(capture.upright(), whole.upright(), "the up direction is kept");
        assert!(capture.release().is_none(), "Gaussians are released once");
    }
}
