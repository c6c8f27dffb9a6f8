//! Colliders as words: points of 16 bits for each axis, triangles as the differences of their indices.
//!
//! In: [`Colliders`]. Out: the field of the header that describes them, and the words of their sections; and back,
//! rounded as [`Colliders::rounded`] does.

use crate::scene::{ColliderGrid, ColliderMesh, ColliderStretch, Colliders};
use serde::{Deserialize, Serialize};
use std::iter::once;
use std::mem::replace;

/// Colliders, without their points and triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StoredColliders {
    /// The smallest corner of the box of all points, capture space.
    pub low: [f32; 3],
    /// The largest corner of that box, capture space.
    pub high: [f32; 3],
    /// What is solid at every moment.
    pub standing: StoredMesh,
    /// What moves, in ascending time.
    pub stretches: Vec<StoredStretch>,
}

/// The mesh of a stretch of time, without its points and triangles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StoredStretch {
    /// The first time, timestamp units.
    pub from: f32,
    /// The end, timestamp units.
    pub to: f32,
    /// What is solid between them.
    pub mesh: StoredMesh,
}

/// The numbers of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredMesh {
    /// Number of points.
    pub points: usize,
    /// Number of triangles.
    pub triangles: usize,
}

impl StoredColliders {
    /// Returns the numbers of colliders.
    pub(super) fn of(colliders: &Colliders) -> Self {
        let ColliderGrid { low, high } = ColliderGrid::of(colliders);
        let stored = |mesh: &ColliderMesh| StoredMesh { points: mesh.points.len(), triangles: mesh.triangles.len() };
        let stretch = |stretch: &ColliderStretch| StoredStretch {
            from: stretch.from,
            to: stretch.to,
            mesh: stored(&stretch.mesh),
        };
        let stretches = colliders.stretches.iter().map(stretch).collect();
        Self { low, high, standing: stored(&colliders.standing), stretches }
    }

    /// Returns the numbers of points and of triangles of all meshes.
    pub(super) fn counts(&self) -> [usize; 2] {
        let moving = self.stretches.iter().map(|stretch| &stretch.mesh);
        once(&self.standing).chain(moving).fold([0usize; 2], |[points, triangles], mesh| {
            [points.saturating_add(mesh.points), triangles.saturating_add(mesh.triangles)]
        })
    }

    /// Returns the bytes of the meshes in memory, beside their words.
    pub(super) fn memory(&self) -> u64 {
        let [points, triangles] = self.counts().map(|count| count as u64);
        let (point, triangle) = (size_of::<[f32; 3]>() as u64, size_of::<[u32; 3]>() as u64);
        points.saturating_mul(point).saturating_add(triangles.saturating_mul(triangle))
    }

    /// Checks the numbers. Afterwards the words can be allocated, and every point on the grid is finite.
    pub(super) fn check(&self) -> Result<(), &'static str> {
        Colliders::check_counts(self.counts())?;
        Colliders::check_times(self.stretches.iter().map(|stretch| [stretch.from, stretch.to]))?;
        let is_ascending = |(low, high): (&f32, &f32)| low.is_finite() && high.is_finite() && low <= high;
        match self.low.iter().zip(&self.high).all(is_ascending) {
            true => Ok(()),
            false => Err("a box of colliders that is not finite, or whose corners are not in order"),
        }
    }
}

/// The words of the sections of colliders.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct ColliderWords {
    /// The positions of points on the grid of the box: x in the lower half of the first word, y in its upper half, z.
    pub points: Vec<[u32; 2]>,
    /// The indices of triangles, each as its difference from the index before in the same mesh, of which the first is
    /// a difference from 0. The lowest bit is the sign.
    pub triangles: Vec<[u32; 3]>,
}

impl ColliderWords {
    /// Returns the words of colliders.
    pub(super) fn of(colliders: &Colliders) -> Self {
        let grid = ColliderGrid::of(colliders);
        let points = colliders.meshes().flat_map(|mesh| &mesh.points).map(|point| {
            let [x, y, z] = grid.steps(*point).map(u32::from);
            [x | y << 16, z]
        });
        let triangles = colliders.meshes().flat_map(|mesh| {
            let mut before = 0u32;
            mesh.triangles.iter().map(move |&triangle| {
                triangle.map(|index| signed_last(index.wrapping_sub(replace(&mut before, index))))
            })
        });
        Self { points: points.collect(), triangles: triangles.collect() }
    }

    /// Returns the colliders of a checked header. Indices of triangles may be out of range: [`Colliders::check`]
    /// refuses them.
    pub(super) fn into_colliders(self, stored: &StoredColliders) -> Colliders {
        let grid = ColliderGrid { low: stored.low, high: stored.high };
        let mut points = self.points.iter().map(|&[xy, z]| grid.point([xy as u16, (xy >> 16) as u16, z as u16]));
        let mut triangles = self.triangles.iter();
        let mut next_mesh = |stored: StoredMesh| {
            let mut index = 0u32;
            let mut next_index = |word: u32| {
                index = index.wrapping_add(signed_first(word));
                index
            };
            ColliderMesh {
                points: points.by_ref().take(stored.points).collect(),
                triangles: triangles.by_ref().take(stored.triangles).map(|&words| words.map(&mut next_index)).collect(),
            }
        };
        let standing = next_mesh(stored.standing);
        let next_stretch =
            |&StoredStretch { from, to, mesh }: &StoredStretch| ColliderStretch { from, to, mesh: next_mesh(mesh) };
        Colliders { standing, stretches: stored.stretches.iter().map(next_stretch).collect() }
    }
}

/// Returns a difference with its sign in the lowest bit, so that small differences of either sign are small numbers.
fn signed_last(difference: u32) -> u32 {
    (difference << 1) ^ (difference >> 31).wrapping_neg()
}

/// Returns a difference whose sign is in the lowest bit.
fn signed_first(word: u32) -> u32 {
    (word >> 1) ^ (word & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colliders() -> Colliders {
        let mesh = |points: &[[f32; 3]], triangles: &[[u32; 3]]| ColliderMesh {
            points: points.to_vec(),
            triangles: triangles.to_vec(),
        };
        let stretch = |from, to, mesh| ColliderStretch { from, to, mesh };
        Colliders {
            standing: mesh(&[[0.0, -1.0, 8.0], [2.0, 1.0, 7.0], [1.0, 0.0, 7.5]], &[[0, 2, 1], [2, 0, 1]]),
            stretches: vec![
                stretch(0.0, 0.5, ColliderMesh::default()),
                stretch(0.5, 1.0, mesh(&[[0.5, 0.5, 7.5], [2.0, 0.5, 8.0]], &[[1, 1, 0]])),
            ],
        }
    }

    #[test]
    fn words_are_positions_in_the_box_and_differences_of_indices() {
        let words = ColliderWords::of(&colliders());
        // 0.5 of an axis is the position 32767.5, which rounds up.
        let points: [[u32; 2]; 5] =
            [[0, 65535], [0xffff_ffff, 0], [0x8000_8000, 32768], [49151 << 16 | 16384, 32768], [0xbfff_ffff, 65535]];
        assert_eq!(words.points, points, "two words for each point");
        let triangles: [[u32; 3]; 3] = [[0, 4, 1], [2, 3, 2], [2, 0, 1]];
        assert_eq!(words.triangles, triangles, "each mesh begins at 0");
    }

    #[test]
    fn words_become_the_rounded_colliders() {
        let plain = colliders();
        let stored = StoredColliders::of(&plain);
        assert_eq!((stored.counts(), stored.memory()), ([5, 3], 96), "the numbers of all meshes");
        assert_eq!(stored.check(), Ok(()), "good numbers");
        let again = ColliderWords::of(&plain).into_colliders(&stored);
        assert_eq!(again, plain.rounded(), "as colliders are rounded");
        assert_eq!(StoredColliders::of(&again), stored, "the box stays");
        let none = Colliders::default();
        let nothing = ColliderWords::of(&none).into_colliders(&StoredColliders::of(&none));
        assert_eq!(nothing, none, "nothing is solid");
    }

    #[test]
    fn differences_of_either_sign_are_small_and_come_back() {
        for (difference, word) in [(0u32, 0), (u32::MAX, 1), (1, 2), (u32::MAX - 1, 3), (1 << 31, u32::MAX)] {
            assert_eq!((signed_last(difference), signed_first(word)), (word, difference), "of {difference}");
        }
        let ends = [[u32::MAX, 0, u32::MAX], [1 << 31, 7, 0]];
        let mesh = ColliderMesh { points: Vec::new(), triangles: ends.to_vec() };
        let wild = Colliders { standing: mesh, stretches: Vec::new() };
        let again = ColliderWords::of(&wild).into_colliders(&StoredColliders::of(&wild));
        assert_eq!(again, wild, "indices out of range come back, too");
    }

    #[test]
    fn wrong_numbers_are_refused() {
        let changes: [fn(&mut StoredColliders); 9] = [
            |stored| stored.standing.points = Colliders::MOST_POINTS,
            |stored| stored.standing.points = usize::MAX,
            |stored| stored.stretches[0].mesh.triangles = Colliders::MOST_TRIANGLES,
            |stored| stored.stretches[0].mesh.triangles = usize::MAX,
            |stored| stored.stretches[1].from = 0.25,
            |stored| stored.stretches[1].to = f32::NAN,
            |stored| stored.low[1] = f32::NEG_INFINITY,
            |stored| stored.high[2] = f32::NAN,
            |stored| stored.low[0] = 3.0,
        ];
        for (index, change) in changes.into_iter().enumerate() {
            let mut bad = StoredColliders::of(&colliders());
            change(&mut bad);
            assert!(bad.check().is_err(), "the numbers with index {index} are refused");
        }
    }
}
