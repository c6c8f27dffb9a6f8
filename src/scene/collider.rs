//! Colliders: closed meshes of the solid parts of a capture, for the physics of a game.
//!
//! In: a mesh of what never moves, and one for each stretch of time of what moves, in capture space. Out: the
//! [`Colliders`], checked, which return the mesh of a time; rounded as packages store them.

use glam::Vec3;
use std::iter::once;

/// Meshes of the solid parts of a capture.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Colliders {
    /// What is solid at every moment. May be empty.
    pub standing: ColliderMesh,
    /// What moves, in ascending time; each begins where the one before ends. May be empty.
    pub stretches: Vec<ColliderStretch>,
}

/// The mesh of what moves, for a stretch of time.
#[derive(Debug, Clone, PartialEq)]
pub struct ColliderStretch {
    /// The first time, timestamp units.
    pub from: f32,
    /// The end, timestamp units; it belongs to the next stretch, if there is one.
    pub to: f32,
    /// What is solid at any of the moments at which it was looked at: by `gs4d collide` five in a stretch, both ends
    /// included. May be empty.
    pub mesh: ColliderMesh,
}

/// A closed mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ColliderMesh {
    /// The corners of the triangles, capture space.
    pub points: Vec<[f32; 3]>,
    /// Indices of three points each, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Colliders {
    /// Most stretches of time of a capture: almost seven minutes at ten a second.
    pub const MOST_STRETCHES: usize = 4096;
    /// Most points of all meshes of a capture.
    pub const MOST_POINTS: usize = 1 << 20;
    /// Most triangles of all meshes of a capture.
    pub const MOST_TRIANGLES: usize = 1 << 21;

    /// Returns the index of the stretch at `time`, timestamp units: the first one before all of them, the last one
    /// after them; `None` if there are none, or the time is NaN.
    pub fn stretch_at(&self, time: f32) -> Option<usize> {
        if self.stretches.is_empty() || time.is_nan() {
            return None;
        }
        Some(self.stretches.partition_point(|stretch| stretch.from <= time).saturating_sub(1))
    }

    /// Returns all meshes: the standing one, then those of the stretches.
    pub fn meshes(&self) -> impl Iterator<Item = &ColliderMesh> {
        once(&self.standing).chain(self.stretches.iter().map(|stretch| &stretch.mesh))
    }

    /// Returns the numbers of points and of triangles of all meshes.
    pub fn counts(&self) -> [usize; 2] {
        self.meshes()
            .fold([0, 0], |[points, triangles], mesh| [points + mesh.points.len(), triangles + mesh.triangles.len()])
    }

    /// Returns them with the points that a package stores: 16 bits for each axis, over the box of all points. Each
    /// coordinate moves by half a step of 1/65535 of the box at most. Rounding again changes no bit.
    pub fn rounded(mut self) -> Self {
        let grid = ColliderGrid::of(&self);
        let moving = self.stretches.iter_mut().map(|stretch| &mut stretch.mesh);
        for point in once(&mut self.standing).chain(moving).flat_map(|mesh| &mut mesh.points) {
            *point = grid.point(grid.steps(*point));
        }
        self
    }

    /// Checks that they can be used: finite points, triangles of points that exist, finite times of which each
    /// stretch begins where the one before ends, and no more of all than a capture may have.
    ///
    /// # Errors
    /// A description of the first fault.
    pub fn check(&self) -> Result<(), &'static str> {
        Self::check_counts(self.counts())?;
        Self::check_times(self.stretches.iter().map(|stretch| [stretch.from, stretch.to]))?;
        self.meshes().try_for_each(ColliderMesh::check)
    }

    /// Checks the numbers of points and triangles of all meshes.
    pub(crate) fn check_counts([points, triangles]: [usize; 2]) -> Result<(), &'static str> {
        if points > Self::MOST_POINTS {
            return Err("more than 1048576 points of colliders: fewer cells, or fewer stretches a second");
        }
        if triangles > Self::MOST_TRIANGLES {
            return Err("more than 2097152 triangles of colliders: fewer cells, or fewer stretches a second");
        }
        Ok(())
    }

    /// Checks the times at which each stretch begins and ends.
    pub(crate) fn check_times(times: impl ExactSizeIterator<Item = [f32; 2]>) -> Result<(), &'static str> {
        if times.len() > Self::MOST_STRETCHES {
            return Err("more than 4096 stretches of colliders: fewer stretches a second");
        }
        let mut before = None;
        for [from, to] in times {
            if !(from.is_finite() && to.is_finite() && from < to) {
                return Err("a stretch of colliders whose times are not finite, or not in ascending order");
            }
            if before.is_some_and(|before| before != from) {
                return Err("a stretch of colliders that does not begin where the one before it ends");
            }
            before = Some(to);
        }
        Ok(())
    }
}

impl ColliderMesh {
    /// Returns whether it has no triangle.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Returns the smallest and the largest corner of the box of its points, capture space; `None` without points.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        let points = self.points.iter().map(|&point| [Vec3::from(point); 2]);
        points.reduce(|[low, high], [point, _]| [low.min(point), high.max(point)])
    }

    fn check(&self) -> Result<(), &'static str> {
        if !self.points.iter().flatten().all(|value| value.is_finite()) {
            return Err("a point of colliders that is not finite");
        }
        let count = self.points.len();
        if self.triangles.iter().flatten().any(|&index| index as usize >= count) {
            return Err("a triangle of colliders with a point that does not exist");
        }
        Ok(())
    }
}

/// The grid to which the points of all meshes are rounded: 65536 positions along each axis of a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ColliderGrid {
    /// The smallest corner, capture space.
    pub low: [f32; 3],
    /// The largest corner, capture space.
    pub high: [f32; 3],
}

impl ColliderGrid {
    /// Returns the grid over the box of all points; without points, over the origin.
    pub(crate) fn of(colliders: &Colliders) -> Self {
        let boxes = colliders.meshes().filter_map(ColliderMesh::bounds);
        let bounds = boxes.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]).unwrap_or_default();
        // Zeros lose their signs here: which of two zeros is the smaller one would depend on the order of the points.
        let [low, high] = bounds.map(|corner| (corner + Vec3::ZERO).to_array());
        Self { low, high }
    }

    /// Returns the position on the grid that is nearest to a point of the box, in steps from the smallest corner.
    pub(crate) fn steps(&self, point: [f32; 3]) -> [u16; 3] {
        std::array::from_fn(|axis| {
            let [low, high, value] = [self.low[axis], self.high[axis], point[axis]].map(f64::from);
            // On an axis without length this is NaN, which converts to 0.
            ((value - low) / (high - low) * f64::from(u16::MAX)).round() as u16
        })
    }

    /// Returns the point at a position on the grid. The first and the last one are the corners of the box themselves.
    pub(crate) fn point(&self, steps: [u16; 3]) -> [f32; 3] {
        std::array::from_fn(|axis| match steps[axis] {
            0 => self.low[axis],
            u16::MAX => self.high[axis],
            step => {
                let [low, high] = [self.low[axis], self.high[axis]].map(f64::from);
                (low + (high - low) * (f64::from(step) / f64::from(u16::MAX))) as f32
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    /// Returns a tetrahedron with its corners at the origin and at a distance of `size` along each axis.
    fn tetrahedron(size: f32) -> ColliderMesh {
        let points = vec![[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
        ColliderMesh { points, triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }
    }

    fn colliders() -> Colliders {
        let stretch = |from, to, size| ColliderStretch { from, to, mesh: tetrahedron(size) };
        Colliders { standing: tetrahedron(2.0), stretches: vec![stretch(0.25, 0.5, 1.0), stretch(0.5, 1.0, -3.0)] }
    }

    /// Returns colliders of points alone.
    fn cloud(points: Vec<[f32; 3]>) -> Colliders {
        Colliders { standing: ColliderMesh { points, triangles: Vec::new() }, stretches: Vec::new() }
    }

    fn bits(colliders: &Colliders) -> Vec<[u32; 3]> {
        colliders.meshes().flat_map(|mesh| &mesh.points).map(|point| point.map(f32::to_bits)).collect()
    }

    #[test]
    fn a_stretch_holds_from_its_first_time_to_the_next() {
        let colliders = colliders();
        for (time, expected) in [
            (f32::NEG_INFINITY, Some(0)),
            (0.0, Some(0)),
            (0.25, Some(0)),
            (0.499, Some(0)),
            (0.5, Some(1)),
            (1.0, Some(1)),
            (f32::INFINITY, Some(1)),
            (f32::NAN, None),
        ] {
            assert_eq!(colliders.stretch_at(time), expected, "the stretch at {time}");
        }
        assert_eq!(Colliders::default().stretch_at(0.5), None, "there is no stretch");
    }

    #[test]
    fn meshes_are_in_order_and_have_the_bounds_of_their_points() {
        let colliders = colliders();
        let sizes: Vec<_> = colliders.meshes().map(ColliderMesh::bounds).collect();
        let expected = [2.0, 1.0].map(|size| Some([Vec3::ZERO, Vec3::splat(size)]));
        assert_eq!(sizes[..2], expected, "the standing mesh, then the first stretch");
        assert_eq!(sizes[2], Some([Vec3::splat(-3.0), Vec3::ZERO]), "the last stretch");
        assert!(!colliders.standing.is_empty(), "four triangles");
        let empty = ColliderMesh::default();
        assert!(empty.is_empty() && empty.bounds().is_none(), "no triangle and no point");
    }

    #[test]
    fn faults_are_refused() {
        assert_eq!(colliders().check(), Ok(()), "good colliders");
        assert_eq!(Colliders::default().check(), Ok(()), "nothing is solid");
        let changes: [(fn(&mut Colliders), &str); 11] = [
            (|all| all.standing.points[1][2] = f32::NAN, "not finite"),
            (|all| all.stretches[1].mesh.points[0][0] = f32::INFINITY, "not finite"),
            (|all| all.standing.triangles[3][1] = 4, "does not exist"),
            (|all| all.stretches[0].mesh.triangles[0][0] = u32::MAX, "does not exist"),
            (|all| all.stretches[0].mesh.points.clear(), "does not exist"),
            (|all| all.stretches[0].from = f32::NAN, "not finite"),
            (|all| all.stretches[1].to = f32::INFINITY, "not finite"),
            (|all| all.stretches[1].to = 0.5, "ascending"),
            (|all| all.stretches[1].from = 0.75, "does not begin"),
            (|all| all.stretches.reverse(), "does not begin"),
            (|all| all.standing.points = vec![[0.0; 3]; Colliders::MOST_POINTS], "points"),
        ];
        for (index, (change, expected)) in changes.into_iter().enumerate() {
            let mut bad = colliders();
            change(&mut bad);
            let fault = bad.check().expect_err("must be refused");
            assert!(fault.contains(expected), "the fault with index {index} is refused: {fault}");
        }
        let mut many = colliders();
        many.standing.triangles = vec![[0, 1, 2]; Colliders::MOST_TRIANGLES];
        assert!(many.check().is_err_and(|fault| fault.contains("triangles")), "too many triangles");
        let second = |index| ColliderStretch { from: index as f32, to: index as f32 + 1.0, mesh: tetrahedron(1.0) };
        let long = Colliders { stretches: (0..=Colliders::MOST_STRETCHES).map(second).collect(), ..colliders() };
        assert!(long.check().is_err_and(|fault| fault.contains("stretches")), "too many stretches");
    }

    #[test]
    fn points_are_rounded_by_half_a_step_at_most_and_then_stay() {
        let mut random = Random::new(1);
        // The third box has steps between two spacings of single precision, the fourth finer ones than both.
        let boxes = [
            ([-1.0; 3], [3.0, 1.0, -0.5]),
            ([0.0; 3], [1e-38, 1e30, 0.0]),
            ([127.5, -128.4, 1023.0], [128.4, -127.5, 1024.9]),
            ([1e6, -1e6, -0.001], [1e6 + 1.0, -1e6 + 2.0, 0.001]),
            ([f32::MIN; 3], [f32::MAX; 3]),
        ];
        for (low, high) in boxes {
            let within = |random: &mut Random| {
                std::array::from_fn(|axis| {
                    let part = random.unit();
                    (low[axis] * (1.0 - part) + high[axis] * part).clamp(low[axis], high[axis])
                })
            };
            let mut points: Vec<[f32; 3]> = (0..2000).map(|_| within(&mut random)).collect();
            points.extend([low, high]);
            let plain = cloud(points);
            let rounded = plain.clone().rounded();
            assert_eq!(ColliderGrid::of(&plain), ColliderGrid { low, high }, "the box of all points");
            assert_eq!(ColliderGrid::of(&rounded), ColliderGrid { low, high }, "the box stays");
            for (point, moved) in plain.standing.points.iter().zip(&rounded.standing.points) {
                for axis in 0..3 {
                    let [low, high, value, moved] = [low[axis], high[axis], point[axis], moved[axis]].map(f64::from);
                    // Beside the step, a coordinate is rounded to single precision.
                    let most = 0.5 * (high - low) / 65535.0 + 2f64.powi(-24) * value.abs().max(moved.abs());
                    let off = (value - moved).abs();
                    assert!(off <= most * (1.0 + 1e-9) + 1e-45, "{value} moves by {off}, not by {most} at most");
                }
            }
            assert_eq!(bits(&rounded), bits(&rounded.clone().rounded()), "the points of {low:?} to {high:?} stay");
        }
    }

    #[test]
    fn all_meshes_are_rounded_over_one_box() {
        let mut all = colliders();
        all.stretches[0].mesh.points[1][0] = 0.999_99;
        let rounded = all.clone().rounded();
        assert_eq!(ColliderGrid::of(&all), ColliderGrid { low: [-3.0; 3], high: [2.0; 3] }, "the box of all meshes");
        let moved = rounded.stretches[0].mesh.points[1][0];
        assert!(moved != 0.999_99 && (moved - 0.999_99).abs() < 4e-5, "a point of a stretch moves to {moved}");
        assert_eq!(rounded.standing.points[1][0], 2.0, "a corner of the box stays");
        let same = |a: &Colliders, b: &Colliders| {
            a.meshes().map(|mesh| &mesh.triangles).eq(b.meshes().map(|mesh| &mesh.triangles))
        };
        assert!(same(&all, &rounded), "the triangles stay");
        assert_eq!(rounded.check(), Ok(()), "rounded colliders can be used");
    }

    #[test]
    fn zeros_of_either_sign_are_rounded_alike() {
        let [plus, minus] = [[[0.0, 1.0, -1.0], [-0.0, -0.0, 0.0]], [[-0.0, 1.0, -1.0], [0.0, 0.0, -0.0]]];
        let rounded = [plus, minus].map(|points| bits(&cloud(points.to_vec()).rounded()));
        assert_eq!(rounded[0], rounded[1], "the signs of zeros do not matter");
        assert_eq!(bits(&Colliders::default().rounded()), Vec::<[u32; 3]>::new(), "no points at all");
    }
}
