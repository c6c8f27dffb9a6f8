//! The solid parts of a capture over its time.
//!
//! In: a capture, [`CollideSettings`]. Out: its [`Colliders`], with numbers about them ([`Collided`]). The smallest
//! opacity of a cell over all moments tells what stands, the largest over those of a stretch of time what moves there.
//! The opacities of each moment are computed twice, since those of all moments are too many to be kept.

use super::clip::Clip;
use super::drawn::drawn;
use super::error::CollideError;
use super::grid::Grid;
use super::mesh::mesh;
use super::occupancy::Occupancy;
use super::settings::CollideSettings;
use super::solid::Solid;
use super::standing::Standing;
use crate::offline::work::{Progress, proceed};
use crate::scene::{ColliderMesh, ColliderStretch, Colliders, GaussianScene};
use rayon::prelude::*;

/// The solid parts of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Collided {
    /// The meshes, with points as a package stores them.
    pub colliders: Colliders,
    /// The smallest and the largest corner of the box that was searched, capture space.
    pub bounds: [[f32; 3]; 2],
    /// The side of a cell, capture units.
    pub cell: f32,
    /// The number of solid cells that stand, and the largest number of those that move in a stretch of time.
    pub solid: [usize; 2],
}

/// Finds the solid parts of a capture. Begins the tasks "finding what stands" and "finding what moves". A still has no
/// stretches of time, and neither has a capture of which nothing moves; neighboring stretches of the same solid cells
/// are one.
///
/// # Errors
/// Settings out of their range, a capture whose parts do not fit together or in which nothing is solid, stretches or meshes beyond the limits of
/// [`Colliders`], a Gaussian that cannot be drawn, an interruption.
pub fn collide(
    scene: &GaussianScene,
    settings: &CollideSettings,
    progress: &mut dyn Progress,
) -> Result<Collided, CollideError> {
    settings.check()?;
    scene.check().map_err(CollideError::Invalid)?;
    let clip = Clip::of(scene, settings.rate)?;
    let drawn = drawn(scene)?;
    let grid = Grid::of(&drawn, clip.span, settings)?;
    let occupancy = Occupancy::of(&drawn, grid, scene.trained_with.marginal_cutoff);
    drop(drawn);
    let search = Search { clip, grid, occupancy, settings };
    let mut colliders = Colliders::default();
    let standing = search.standing(&mut colliders, progress)?;
    let moving = if clip.stretches > 0 { search.stretches(&standing, &mut colliders, progress)? } else { 0 };
    if colliders.meshes().all(ColliderMesh::is_empty) {
        return Err(CollideError::NothingSolid { level: settings.level });
    }
    let colliders = colliders.rounded();
    colliders.check().map_err(CollideError::Invalid)?;
    let bounds = [grid.low, grid.high()].map(|corner| corner.as_vec3().to_array());
    Ok(Collided { colliders, bounds, cell: grid.cell as f32, solid: [standing.cells.count(), moving] })
}

/// The inputs of a search.
struct Search<'a> {
    clip: Clip,
    grid: Grid,
    occupancy: Occupancy,
    settings: &'a CollideSettings,
}

impl Search<'_> {
    /// Returns the cells of at least the level of the settings.
    fn solid(&self, thickness: &[f32]) -> Solid {
        // The opacity is 1 − e^−thickness.
        Solid::of(self.grid, thickness, -(-self.settings.level).ln_1p())
    }

    /// Returns what stands, and adds its mesh.
    fn standing(&self, colliders: &mut Colliders, progress: &mut dyn Progress) -> Result<Standing, CollideError> {
        let CollideSettings { level, error, smallest, .. } = *self.settings;
        let mut thickness = vec![f32::INFINITY; self.grid.len()];
        progress.begin("finding what stands", self.clip.moments().count());
        for time in self.clip.moments() {
            proceed(progress)?;
            combine(&mut thickness, &self.occupancy.at(time), f32::min);
            progress.advance();
        }
        let standing = Standing::of(&self.solid(&thickness), &thickness, smallest);
        colliders.standing = mesh(&standing.cells, &thickness, level, error);
        progress.finish();
        check_size(colliders)?;
        Ok(standing)
    }

    /// Adds the meshes of what moves. Returns the largest number of cells of a stretch.
    fn stretches(
        &self,
        standing: &Standing,
        colliders: &mut Colliders,
        progress: &mut dyn Progress,
    ) -> Result<usize, CollideError> {
        let CollideSettings { level, error, smallest, .. } = *self.settings;
        let mut largest = 0;
        let mut before: Option<Solid> = None;
        progress.begin("finding what moves", self.clip.moments().count());
        let mut border = self.occupancy.at(self.clip.time(0.0));
        progress.advance();
        for stretch in 0..self.clip.stretches {
            let mut thickness = std::mem::take(&mut border);
            for time in self.clip.moments_after(stretch) {
                proceed(progress)?;
                border = self.occupancy.at(time);
                combine(&mut thickness, &border, f32::max);
                progress.advance();
            }
            let [from, to] = [stretch, stretch + 1].map(|stretch| self.clip.time(stretch as f64));
            let moving = standing.moving(&self.solid(&thickness), &thickness, smallest);
            if before.as_ref() == Some(&moving)
                && let Some(last) = colliders.stretches.last_mut()
            {
                last.to = to;
                continue;
            }
            largest = largest.max(moving.count());
            let mesh = mesh(&moving, &thickness, level, error);
            colliders.stretches.push(ColliderStretch { from, to, mesh });
            check_size(colliders)?;
            before = Some(moving);
        }
        progress.finish();
        if largest == 0 {
            colliders.stretches.clear();
        }
        Ok(largest)
    }
}

/// Replaces each value by the chosen one of both.
fn combine(values: &mut [f32], others: &[f32], choose: fn(f32, f32) -> f32) {
    values.par_iter_mut().zip(others).for_each(|(value, other)| *value = choose(*value, *other));
}

/// Checks that a capture may have meshes of this size.
fn check_size(colliders: &Colliders) -> Result<(), CollideError> {
    Colliders::check_counts(colliders.counts()).map_err(|_| CollideError::TooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Gaussian, Harmonics};
    use crate::offline::work::NoProgress;
    use crate::offline::work::progress::InterruptedProgress;
    use crate::scene::RuntimeScene;
    use glam::Vec3;
    use std::f32::consts::PI;

    /// Where the ball is at the beginning and at the end.
    const WAY: [Vec3; 2] = [Vec3::new(-0.6, 0.0, 0.5), Vec3::new(0.6, 0.0, 0.5)];
    /// A point in the block that stands.
    const INSIDE: Vec3 = Vec3::new(0.0, 0.0, -0.7);

    fn gaussian(mean: Vec3, variance: f32) -> Gaussian {
        Gaussian {
            mean: mean.to_array(),
            mean_t: 0.5,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [variance, 0.0, 0.0, variance, 0.0, variance],
            opacity: 0.9,
            padding: 0.0,
        }
    }

    /// Returns Gaussians at a distance of 0.1 wherever `is_in` holds, in a cube of side 2 around the origin.
    fn lattice(is_in: impl Fn(Vec3) -> bool) -> Vec<Gaussian> {
        let place = |index: i32| Vec3::new((index % 21) as f32, (index / 21 % 21) as f32, (index / 441) as f32);
        let places = (0..21 * 21 * 21).map(|index| place(index) * 0.1 - 1.0);
        places.filter(|&place| is_in(place)).map(|place| gaussian(place, 0.0025)).collect()
    }

    /// Returns a flat block of the height 0.6.
    fn block() -> Vec<Gaussian> {
        lattice(|place| place.z < -0.35)
    }

    /// Returns a ball of the radius 0.35 around a point, at the time 0.5.
    fn ball(center: Vec3) -> Vec<Gaussian> {
        let mut ball = lattice(|place| place.length() < 0.36);
        ball.iter_mut().for_each(|gaussian| gaussian.mean = (Vec3::from(gaussian.mean) + center).to_array());
        ball
    }

    /// Returns the ball that moves over its way.
    fn moving_ball() -> Vec<Gaussian> {
        let [from, to] = WAY;
        let mut ball = ball(0.5 * (from + to));
        ball.iter_mut().for_each(|gaussian| gaussian.velocity = (to - from).to_array());
        ball
    }

    fn scene(parts: &[Vec<Gaussian>]) -> GaussianScene {
        let gaussians = parts.concat();
        let values = vec![0.0; 3 * gaussians.len()];
        RuntimeScene::sliced(gaussians, Harmonics { coefficients: 1, values, ..Harmonics::default() }).into()
    }

    /// Returns settings with cells of the side 0.075.
    fn settings(rate: f32) -> CollideSettings {
        CollideSettings { cells: 40, rate, bounds: Some([[-1.5; 3], [1.5; 3]]), ..CollideSettings::default() }
    }

    fn collided(parts: &[Vec<Gaussian>], settings: &CollideSettings) -> Collided {
        collide(&scene(parts), settings, &mut NoProgress).expect("something is solid")
    }

    /// Returns whether a point is inside a closed mesh: the angles at which it sees the front of triangles add up to
    /// the whole sphere.
    fn holds(mesh: &ColliderMesh, point: Vec3) -> bool {
        let angle = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|index| Vec3::from(mesh.points[index as usize]) - point);
            let lengths = Vec3::new(a.length(), b.length(), c.length());
            let rest = a.dot(b) * lengths.z + b.dot(c) * lengths.x + c.dot(a) * lengths.y;
            2.0 * a.dot(b.cross(c)).atan2(lengths.element_product() + rest)
        };
        let turns = mesh.triangles.iter().map(angle).sum::<f32>() / (4.0 * PI);
        assert!((turns - turns.round()).abs() < 1e-2 && turns > -0.5, "{point} is on no surface: {turns}");
        turns > 0.5
    }

    #[test]
    fn what_stands_and_what_moves_are_told_apart() {
        let found = collided(&[block(), moving_ball()], &settings(5.0));
        let Colliders { standing, stretches } = &found.colliders;
        assert!(holds(standing, INSIDE), "the block stands");
        assert!(!holds(standing, WAY[0]) && !holds(standing, WAY[1]), "the ball does not");
        assert_eq!(stretches.len(), 5, "five stretches in a second");
        let borders: Vec<[f32; 2]> = stretches.iter().map(|stretch| [stretch.from, stretch.to]).collect();
        assert_eq!((borders[0][0], borders[4][1]), (0.0, 1.0), "they cover the time");
        assert!(borders.windows(2).all(|pair| pair[0][1] == pair[1][0]), "and meet: {borders:?}");
        for ColliderStretch { from, to, mesh } in stretches {
            let [first, middle, last] = [*from, 0.5 * (from + to), *to].map(|time| WAY[0].lerp(WAY[1], time));
            assert!([first, middle, last].iter().all(|&place| holds(mesh, place)), "the ball from {from} to {to}");
            let beside = [first - Vec3::X * 0.6, last + Vec3::X * 0.6, middle + Vec3::Z * 0.6, INSIDE];
            assert!(!beside.iter().any(|&place| holds(mesh, place)), "nothing around it from {from} to {to}");
        }
        let [stands, moves] = found.solid;
        assert!(stands > 5000 && (400..1600).contains(&moves), "{stands} cells stand and {moves} move");
        assert!((found.cell - 0.075).abs() < 1e-6, "the side of a cell is {}", found.cell);
        assert_eq!(found.colliders.clone().rounded(), found.colliders, "points are those that a package stores");
    }

    #[test]
    fn without_a_box_the_middle_of_the_capture_is_searched() {
        let settings = CollideSettings { cells: 32, rate: 1.0, ..CollideSettings::default() };
        let found = collided(&[block(), moving_ball()], &settings);
        let [low, high] = found.bounds;
        let margin = 2.0 * found.cell;
        assert!((low[0] + 1.0 + margin).abs() < 0.02, "two cells before the block: {low:?}");
        assert!((high[1] - 1.0 - margin).abs() < 0.02, "two cells after it: {high:?}");
        assert!(holds(&found.colliders.standing, INSIDE), "the block stands");
        assert!(holds(&found.colliders.stretches[0].mesh, 0.5 * (WAY[0] + WAY[1])), "the ball moves");
    }

    #[test]
    fn neighboring_stretches_of_the_same_cells_are_one() {
        let mut late = ball(WAY[0]);
        late.iter_mut().for_each(|gaussian| (gaussian.mean_t, gaussian.sigma_t) = (1.0, 0.1));
        let Colliders { stretches, .. } = collided(&[block(), late], &settings(10.0)).colliders;
        let [first, .., last] = stretches.as_slice() else { panic!("several stretches: {stretches:?}") };
        assert!(first.mesh.is_empty() && first.from == 0.0, "at first nothing moves");
        assert!(first.to > 0.65, "for most of the time, until {}", first.to);
        assert!(holds(&last.mesh, WAY[0]) && last.to == 1.0, "then the ball is there");
    }

    #[test]
    fn what_does_not_move_has_no_stretches() {
        let still = collided(&[block(), ball(WAY[1])], &settings(5.0));
        assert_eq!((still.colliders.stretches.len(), still.solid[1]), (0, 0), "nothing moves");
        assert!(holds(&still.colliders.standing, WAY[1]), "the ball stands");
        let mut scene = scene(&[block(), moving_ball()]);
        scene.playback.duration_seconds = 0.0;
        let still = collide(&scene, &settings(5.0), &mut NoProgress).expect("a still");
        assert!(still.colliders.stretches.is_empty(), "a still has no time");
        assert!(holds(&still.colliders.standing, WAY[0]), "the ball stands where it is at first");
    }

    #[test]
    fn floaters_are_dropped() {
        // At the center of a cell.
        let place = Vec3::new(0.0375, 0.0375, 1.0125);
        let floater = vec![gaussian(place, 0.0036)];
        let dropped = collided(&[block(), floater.clone()], &settings(1.0));
        assert!(!holds(&dropped.colliders.standing, place), "a floater is dropped");
        let all = CollideSettings { smallest: 1, ..settings(1.0) };
        let kept = collided(&[block(), floater], &all);
        assert!(kept.solid[0] > dropped.solid[0], "it is solid: {:?} and {:?}", kept.solid, dropped.solid);
    }

    #[test]
    fn what_is_hollow_is_solid_inside() {
        let turn = PI * (3.0 - 5.0f32.sqrt());
        let on_sphere = |index: i32| {
            let height = 1.0 - (2 * index + 1) as f32 / 1000.0;
            let (sin, cos) = (turn * index as f32).sin_cos();
            Vec3::new(cos, sin, 0.0) * (1.0 - height * height).sqrt() + Vec3::Z * height
        };
        let shell: Vec<Gaussian> = (0..1000).map(|index| gaussian(on_sphere(index) * 0.8, 0.0025)).collect();
        let found = collided(&[shell], &settings(1.0));
        assert!(holds(&found.colliders.standing, Vec3::splat(0.01)), "its middle is inside");
        assert!(!holds(&found.colliders.standing, Vec3::X), "what is around it is not");
    }

    #[test]
    fn captures_without_colliders_are_refused() {
        let refusal = |parts: &[Vec<Gaussian>], settings: &CollideSettings| {
            collide(&scene(parts), settings, &mut NoProgress).expect_err("must be refused")
        };
        let mut faint = block();
        faint.iter_mut().for_each(|gaussian| gaussian.opacity = 0.01);
        let nothing = refusal(&[faint], &settings(1.0));
        assert!(matches!(nothing, CollideError::NothingSolid { .. }), "too faint: {nothing}");
        assert!(nothing.to_string().contains("the level 0.5"), "the level is named: {nothing}");
        let many = refusal(&[block()], &settings(1e5));
        assert!(matches!(many, CollideError::TooManyStretches { stretches: 100_000 }), "too many stretches: {many}");
        let none = refusal(&[], &CollideSettings::default());
        assert!(matches!(none, CollideError::NoExtent), "no Gaussians: {none}");
        let wrong = refusal(&[block()], &CollideSettings { level: 2.0, ..settings(1.0) });
        assert!(matches!(wrong, CollideError::Invalid(_)), "a level above 1: {wrong}");
        let stopped = collide(&scene(&[block()]), &settings(1.0), &mut InterruptedProgress);
        assert!(matches!(stopped, Err(CollideError::Interrupted(_))), "interrupted: {stopped:?}");
    }
}
