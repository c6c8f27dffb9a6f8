//! The nearest of many points.
//!
//! In: points, and the distance up to which neighbors count. Out: [`Neighbors`], which lists the points around a place.

use glam::{IVec3, Vec3};
use std::collections::HashMap;

/// Points in cubes of a grid, whose side is the distance up to which neighbors count.
pub(crate) struct Neighbors {
    places: Vec<Vec3>,
    reach: f32,
    cubes: HashMap<IVec3, Vec<u32>>,
}

impl Neighbors {
    /// Returns the neighbors within `reach`, which is above 0, among these places.
    pub(crate) fn new(places: Vec<Vec3>, reach: f32) -> Self {
        let mut cubes: HashMap<IVec3, Vec<u32>> = HashMap::new();
        for (index, &place) in places.iter().enumerate() {
            cubes.entry(cube(place, reach)).or_default().push(index as u32);
        }
        Self { places, reach, cubes }
    }

    /// Returns the `count` nearest in reach by a cost, the best first, each with its index. The cost is of the index
    /// and the squared distance.
    pub(crate) fn best(&self, place: Vec3, count: usize, cost: impl Fn(usize, f32) -> f32) -> Vec<usize> {
        let mut found: Vec<(f32, usize)> = Vec::new();
        let middle = cube(place, self.reach);
        let steps = || -1..=1;
        for (x, y, z) in steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| (x, y, z)))) {
            for &index in self.cubes.get(&middle.saturating_add(IVec3::new(x, y, z))).into_iter().flatten() {
                let distance = self.places[index as usize].distance_squared(place);
                if distance <= self.reach * self.reach {
                    found.push((cost(index as usize, distance), index as usize));
                }
            }
        }
        if found.len() > count && count > 0 {
            found.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0));
        }
        found.truncate(count);
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, index)| index).collect()
    }
}

/// Returns the cube that a place is in.
fn cube(place: Vec3, side: f32) -> IVec3 {
    (place / side).floor().as_ivec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    #[test]
    fn the_best_are_those_of_a_search_through_all() {
        let mut random = Random::new(3);
        let places: Vec<Vec3> = (0..500).map(|_| Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0)))).collect();
        let neighbors = Neighbors::new(places.clone(), 0.4);
        for &place in &places[..20] {
            let mut expected: Vec<usize> = (0..500).filter(|&other| places[other].distance(place) <= 0.4).collect();
            expected.sort_by(|&a, &b| places[a].distance_squared(place).total_cmp(&places[b].distance_squared(place)));
            expected.truncate(6);
            assert_eq!(neighbors.best(place, 6, |_, distance| distance), expected, "the six nearest of {place}");
        }
        assert!(neighbors.best(Vec3::splat(9.0), 6, |_, distance| distance).is_empty(), "none in reach");
    }
}
