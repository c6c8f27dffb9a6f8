//! The Gaussians before the first step.
//!
//! In: training images, points if there are any, [`StartSettings`]. Out: a scene of native 4D Gaussians at these
//! points, at points of the visual hull, or at random ones in the box that the cameras look at; an environment map
//! behind them if the images show surroundings, or on request.
//!
//! Opacity is 0.1; the spatial scale is the root of the mean squared distance to the three nearest points, of the same
//! time where there are many of each; the temporal scale is a share of the interval; no Gaussian is rotated or moves
//! (section 5.4 of the 4DGS model). On request Gaussians have the velocities of their points, and scales by the nearest
//! of the points that are drawn with them, where these have flown; those at points without a time, beside others with
//! one, have a temporal scale of their own, or, as points of what stands, of three intervals.

use super::error::StartError;
use super::gaussians::{Looks, trained};
use super::hull::hull;
use super::measured::{GRAY, Measured, any_time, in_cube};
use super::point::{Life, StartPoint};
use super::region::Region;
use super::surroundings::{surroundings, usual_rows};
use crate::offline::dataset::CoveredImage;
use crate::offline::dataset::point_cloud::PointCloud;
use crate::offline::train::TrainingImages;
use crate::offline::train::reference::standing::STANDING_TIME_SCALE;
use crate::scene::random::Random;
use crate::scene::{GaussianScene, PlaybackHints, SceneForm, TrainedWith};
use crate::view::View;
use glam::Vec3;

/// Temporal scale, as a share of the interval, unless moments are further apart.
const USUAL_TIME_SCALE: f64 = 0.1;
/// Least squared scale, units of length squared.
const LEAST_SQUARE: f32 = 1e-7;
/// Distance of points that fill a hull of too few, as a share of the half side of the box.
const FILLING: f32 = 0.02;

/// Where the points come from. Default: [`Auto`](Self::Auto).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Start {
    /// From the visual hull if most images have silhouettes, else from the points of the dataset if it has some, else
    /// at random. An empty hull without points is an error: the poses or silhouettes are those of another scene.
    #[default]
    Auto,
    /// From points that were measured: of the dataset, or of a file beside it.
    Points,
    /// From the visual hull of the silhouettes.
    Hull,
    /// At random in the box that the cameras look at.
    Random,
}

impl Start {
    /// Every start with its name.
    pub const NAMES: [(&'static str, Self); 4] =
        [("auto", Self::Auto), ("points", Self::Points), ("hull", Self::Hull), ("random", Self::Random)];

    /// Returns the name.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, start)| *start == self).map_or("", |(name, _)| name)
    }
}

/// How a capture begins. Default: 60,000 Gaussians with the usual temporal scale, colors of degree 3, and degree 2 in
/// time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartSettings {
    /// Number of Gaussians before the first step.
    pub gaussians: usize,
    /// Where their points come from.
    pub start: Start,
    /// Temporal scale, as a share of the interval; `None`: a tenth, and at least the mean step between two moments of
    /// the images. The original's is `√(T/5)` for an interval of length `T`.
    pub time_scale: Option<f64>,
    /// Temporal scale at points without a time, beside others with one, as a share of the interval; `None`: the same.
    pub untimed_scale: Option<f64>,
    /// Share of the Gaussians, 0 to 1, that begin at points with a time, beside others without one; at most four at
    /// each. Default: 0.55.
    pub timed_share: f64,
    /// Whether Gaussians begin with the velocities of their points. Default: `false`.
    pub velocities: bool,
    /// Whether points without a time, beside others with one, begin as Gaussians that stand still during the whole
    /// interval. Default: `false`, they begin at random times.
    pub standing: bool,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Spatial degree of color, 0 to 3.
    pub degree: u32,
    /// Degree of color in time, 0 to 2; used only if `degree` is 3.
    pub degree_t: u32,
    /// Rows of the environment map behind the Gaussians, which has twice as many columns; 0: no map. Default: `None`:
    /// 32 rows if no image has gaps, most border pixels have another color than the background, and all cameras are
    /// within half the radius of the map; else 0.
    pub environment: Option<u32>,
}

impl Default for StartSettings {
    fn default() -> Self {
        Self {
            gaussians: 60_000,
            start: Start::Auto,
            time_scale: None,
            untimed_scale: None,
            timed_share: 0.55,
            velocities: false,
            standing: false,
            seed: 0,
            degree: 3,
            degree_t: 2,
            environment: None,
        }
    }
}

/// Returns the scene before the first step, and where its points come from: `cloud`, the hull, or random places.
///
/// # Errors
/// Cameras without a common region, unless points are given; points that were asked for and are not given; a visual
/// hull that is empty, unless there are points to begin with instead; an environment map that was asked for and that
/// images with transparent pixels do not show.
pub fn begin(
    images: &TrainingImages,
    trained_with: TrainedWith,
    playback: PlaybackHints,
    settings: &StartSettings,
    cloud: Option<&PointCloud>,
) -> Result<(GaussianScene, Start), StartError> {
    let pairs: Vec<(&View, &CoveredImage)> = images.first().collect();
    let rows = settings.environment.unwrap_or_else(|| usual_rows(images, trained_with.background));
    if rows > 0 && images.has_gaps() {
        return Err(StartError::NoSurroundings);
    }
    let region = Region::of(images.all_views());
    let least = LEAST_SQUARE * (trained_with.unit_length() as f32).powi(2);
    let (points, start) = points(&pairs, region, trained_with.time_interval, settings, cloud, least)?;
    let (span, background) = (trained_with.time_span(), trained_with.background);
    let usual = || usual_time_scale(images.all_views().map(|view| view.time).collect());
    let scale_t = settings.time_scale.unwrap_or_else(usual) as f32 * span;
    let untimed_t = settings.untimed_scale.map_or(scale_t, |scale| scale as f32 * span);
    let (degree, degree_t) = (settings.degree.min(3), if settings.degree >= 3 { settings.degree_t.min(2) } else { 0 });
    let looks = Looks { least, scale_t, untimed_t, standing_t: STANDING_TIME_SCALE * span, degree, degree_t };
    let scene = GaussianScene {
        form: SceneForm::Trained(trained(&points, &looks)),
        environment: (rows > 0).then(|| surroundings(background, rows)),
        filter: None,
        trained_with,
        playback,
        levels: Vec::new(),
        sockets: Vec::new(),
        colliders: None,
        sound: None,
        chunks: None,
    };
    Ok((scene, start))
}

/// Returns the usual temporal scale for images of these times, as a share of the interval.
fn usual_time_scale(mut times: Vec<f32>) -> f64 {
    times.sort_by(f32::total_cmp);
    times.dedup();
    let step = 1.0 / (times.len() as f64 - 1.0).max(1.0);
    step.max(USUAL_TIME_SCALE)
}

fn points(
    images: &[(&View, &CoveredImage)],
    region: Result<Region, StartError>,
    interval: [f32; 2],
    settings: &StartSettings,
    cloud: Option<&PointCloud>,
    least: f32,
) -> Result<(Vec<StartPoint>, Start), StartError> {
    let count = settings.gaussians;
    let mut random = Random::new(settings.seed);
    let StartSettings { velocities, standing, timed_share, .. } = *settings;
    let measured = Measured { interval, least, velocities, standing, timed_share };
    if settings.start == Start::Points {
        let PointCloud(own) = cloud.ok_or(StartError::NoPoints)?;
        return Ok((measured.points(own, count, &mut random), Start::Points));
    }
    let with_gaps = images.iter().filter(|(_, image)| image.has_gaps).count();
    let wants_hull = match settings.start {
        Start::Hull => true,
        Start::Points | Start::Random => false,
        Start::Auto => 2 * with_gaps > images.len(),
    };
    if wants_hull {
        if with_gaps == 0 {
            return Err(StartError::NoSilhouettes);
        }
        let region = region.as_ref().map_err(StartError::clone)?;
        let mut found = hull(images, region, interval, count, settings.seed);
        if !found.is_empty() {
            // If the hull has fewer points, further points are placed beside them.
            let own = found.len();
            for index in own..count {
                let beside = in_cube(&mut random) * FILLING * region.half;
                let point = found[index % own];
                found.push(StartPoint { position: point.position + beside, ..point });
            }
            return Ok((found, Start::Hull));
        }
        if settings.start == Start::Hull || cloud.is_none() {
            return Err(StartError::NoHull);
        }
    }
    if let Some(PointCloud(own)) = cloud.filter(|_| settings.start == Start::Auto) {
        return Ok((measured.points(own, count, &mut random), Start::Points));
    }
    let region = region?;
    let mut point = || StartPoint {
        position: region.center + region.half * in_cube(&mut random),
        time: any_time(interval, &mut random),
        color: Vec3::splat(GRAY),
        velocity: Vec3::ZERO,
        life: Life::Timed,
    };
    Ok(((0..count).map(|_| point()).collect(), Start::Random))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::dataset::point_cloud::CloudPoint;
    use crate::view::{Camera, RasterFov};
    use glam::UVec2;

    /// Returns views around the origin with images of which a square is covered.
    fn views(coverage: u8) -> Vec<(View, CoveredImage)> {
        let view = |i: usize| {
            let angle = i as f32 * 1.3;
            let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0);
            let size = UVec2::splat(16);
            let view = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, size).view(0.2 * i as f32, RasterFov::Corrected);
            let texel = |i: u32| {
                let inside = (4..12).contains(&(i % 16)) && (4..12).contains(&(i / 16));
                if inside { [60, 90, 120, 255] } else { [0, 0, 0, coverage] }
            };
            (view, CoveredImage { size, texels: (0..256).map(texel).collect(), has_gaps: coverage < 255 })
        };
        (0..5).map(view).collect()
    }

    fn start(coverage: u8, start: Start, cloud: Option<&PointCloud>) -> Result<(Vec<StartPoint>, Start), StartError> {
        let views = views(coverage);
        let images: Vec<_> = views.iter().map(|(view, image)| (view, image)).collect();
        let region = Region::of(images.iter().map(|(view, _)| *view));
        let settings = StartSettings { gaussians: 700, start, ..StartSettings::default() };
        points(&images, region, [0.0, 0.8], &settings, cloud, LEAST_SQUARE)
    }

    /// Returns so many points on a line, of one color, at times from 0.2.
    fn cloud(count: usize) -> PointCloud {
        let point = |index: usize| CloudPoint {
            position: Vec3::X * index as f32,
            color: Some(Vec3::Y),
            time: Some(0.2 + 1e-4 * index as f32),
            velocity: Vec3::ZERO,
        };
        PointCloud((0..count).map(point).collect())
    }

    #[test]
    fn the_usual_temporal_scale_reaches_the_next_moment() {
        let scale = |moments: u16| usual_time_scale((0..3 * moments).map(|time| f32::from(time % moments)).collect());
        assert_eq!([1, 2, 5].map(scale), [1.0, 1.0, 0.25], "a step between moments, however many cameras see each");
        assert_eq!([11, 100].map(scale), [0.1; 2], "at least a tenth of the interval");
    }

    #[test]
    fn the_start_is_chosen_by_the_images() {
        let found = |coverage, wanted| start(coverage, wanted, None).map(|(points, start)| (points.len(), start));
        assert_eq!(found(0, Start::Auto), Ok((700, Start::Hull)), "silhouettes");
        assert_eq!(found(255, Start::Auto), Ok((700, Start::Random)), "no silhouettes");
        assert_eq!(found(0, Start::Random), Ok((700, Start::Random)), "as asked");
        assert_eq!(found(255, Start::Hull), Err(StartError::NoSilhouettes), "a hull of nothing is refused");
        assert_eq!(found(0, Start::Points), Err(StartError::NoPoints), "no points");
        let cloud = cloud(9);
        let found =
            |coverage, wanted| start(coverage, wanted, Some(&cloud)).map(|(points, start)| (points.len(), start));
        assert_eq!(found(0, Start::Auto), Ok((700, Start::Hull)), "silhouettes before points");
        assert_eq!(found(255, Start::Auto), Ok((700, Start::Points)), "points before random places");
        assert_eq!(found(0, Start::Points), Ok((700, Start::Points)), "as asked");
    }

    #[test]
    fn points_that_are_given_keep_their_places_times_and_colors() {
        for (given, own) in [(40, 40), (700, 700), (5000, 700)] {
            let (found, _) = start(255, Start::Points, Some(&cloud(given))).expect("points are given");
            assert_eq!(found.len(), 700, "{given} points: as many as wanted");
            let whole = |point: &&StartPoint| point.position.x.fract() == 0.0 && point.position.y == 0.0;
            let places: Vec<f32> = found.iter().filter(whole).map(|point| point.position.x).collect();
            let mut unlike = places.clone();
            unlike.sort_by(f32::total_cmp);
            unlike.dedup();
            assert_eq!((places.len(), unlike.len()), (own, own), "{given} points: each at most once in its place");
            for point in &found {
                let index = point.position.x.round().clamp(0.0, given as f32 - 1.0);
                let beside = point.position.distance(Vec3::X * index);
                // The nearest points of those at the ends are one, two and three units away.
                assert!(beside <= 3f32.sqrt() * (14.0f32 / 3.0).sqrt(), "{given} points: beside its point: {beside}");
                assert_eq!(point.color, Vec3::Y, "its color");
                assert!((0.19..0.72).contains(&point.time), "a time of the file: {}", point.time);
            }
            let mut at_time =
                found.iter().filter(whole).map(|point| (point.time - 0.2 - 1e-4 * point.position.x).abs());
            assert!(at_time.all(|error| error < 1e-5), "{given} points: the time of the file");
        }
        let alone = start(255, Start::Points, Some(&cloud(1))).expect("a point is given").0;
        assert!(alone.iter().all(|point| point.position.length() < 1e-3), "all at the only point");
    }
}
