//! Sets of cubes in Morton order.
//!
//! In: Morton codes of cubes in a grid whose side is a power of two, ascending. Out: the codes of their children, of
//! those at the surface, and of clusters that touch. Neighbors in Morton order are near in space, so that every n-th
//! cube is an even choice.

use rayon::prelude::*;

/// Most bits of a coordinate.
const MOST_LEVELS: u32 = 20;
/// One of each two opposite neighbors of a cube, the one that comes later by x, then y, then z: each pair of touching
/// cubes is found once.
const HALF_OF_NEIGHBORS: [[i32; 3]; 13] = [
    [1, -1, -1],
    [1, -1, 0],
    [1, -1, 1],
    [1, 0, -1],
    [1, 0, 0],
    [1, 0, 1],
    [1, 1, -1],
    [1, 1, 0],
    [1, 1, 1],
    [0, 1, -1],
    [0, 1, 0],
    [0, 1, 1],
    [0, 0, 1],
];
/// The neighbors that share a face.
const FACES: [[i32; 3]; 6] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];

/// Returns all cubes of a grid of `2^level` cubes on each side.
pub(crate) fn all(level: u32) -> Vec<u64> {
    (0..1u64 << (3 * level)).collect()
}

/// Returns the eight halves of each cube, in order.
pub(crate) fn children(cells: &[u64]) -> Vec<u64> {
    cells.iter().flat_map(|&cell| (0..8u64).map(move |child| (cell << 3) | child)).collect()
}

/// Returns the coordinates of a cube.
pub(crate) fn coordinates(cell: u64) -> [u32; 3] {
    let bit_of = |axis: u32, bit: u32| ((cell >> (3 * bit + axis)) & 1) as u32;
    [0, 1, 2].map(|axis| (0..MOST_LEVELS).map(|bit| bit_of(axis, bit) << bit).sum())
}

/// Returns the code of a cube.
fn code(coordinates: [u32; 3]) -> u64 {
    let spread = |side: u32| -> u64 { (0..MOST_LEVELS).map(|bit| u64::from((side >> bit) & 1) << (3 * bit)).sum() };
    let [x, y, z] = coordinates.map(spread);
    x | (y << 1) | (z << 2)
}

/// Returns the index of the cube that is so far from another, if it is in the set.
fn beside(cells: &[u64], coordinates: [u32; 3], offset: [i32; 3]) -> Option<usize> {
    let side = |axis: usize| {
        let side = coordinates[axis].checked_add_signed(offset[axis]);
        side.filter(|&side| side < (1 << MOST_LEVELS))
    };
    cells.binary_search(&code([side(0)?, side(1)?, side(2)?])).ok()
}

/// Returns the cubes that have a face without a neighbor, in order.
pub(crate) fn surface(cells: &[u64]) -> Vec<u64> {
    let is_open = |cell: &u64| {
        let at = coordinates(*cell);
        FACES.iter().any(|&face| beside(cells, at, face).is_none())
    };
    cells.par_iter().copied().filter(is_open).collect()
}

/// Returns the number of the cluster of each cube, from 0, and the number of clusters. Cubes of a cluster touch, if
/// only at a corner.
pub(crate) fn clusters(cells: &[u64]) -> (Vec<u32>, usize) {
    let touching = |index: usize| {
        let at = coordinates(cells[index]);
        HALF_OF_NEIGHBORS.iter().filter_map(move |&offset| beside(cells, at, offset)).map(move |other| (index, other))
    };
    let pairs: Vec<(usize, usize)> = (0..cells.len()).into_par_iter().flat_map_iter(touching).collect();
    let mut parents: Vec<usize> = (0..cells.len()).collect();
    for (a, b) in pairs {
        let (a, b) = (root(&mut parents, a), root(&mut parents, b));
        // The first cube of a cluster is its root.
        parents[a.max(b)] = a.min(b);
    }
    let (mut numbers, mut count) = (vec![0u32; cells.len()], 0);
    for index in 0..cells.len() {
        let first = root(&mut parents, index);
        if first == index {
            numbers[index] = count;
            count += 1;
        } else {
            numbers[index] = numbers[first];
        }
    }
    (numbers, count as usize)
}

/// Returns the root of a cube, and shortens the path to it.
fn root(parents: &mut [usize], mut index: usize) -> usize {
    while parents[index] != index {
        parents[index] = parents[parents[index]];
        index = parents[index];
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a solid cube, in order.
    fn solid(first: u32, side: u32) -> Vec<u64> {
        let range = || first..first + side;
        let rows = range().flat_map(|x| range().flat_map(move |y| range().map(move |z| code([x, y, z]))));
        let mut cells: Vec<u64> = rows.collect();
        cells.sort_unstable();
        cells
    }

    #[test]
    fn a_code_says_the_coordinates_and_children_are_halves() {
        assert_eq!(coordinates(code([5, 1023, 70_000])), [5, 1023, 70_000], "the coordinates return");
        let halves = children(&[code([3, 4, 5])]);
        assert!(halves.iter().all(|half| coordinates(*half).map(|side| side / 2) == [3, 4, 5]), "within their parent");
        assert!(halves.is_sorted(), "in order: {halves:?}");
    }

    #[test]
    fn the_surface_of_a_solid_cube_is_hollow() {
        assert_eq!(surface(&solid(7, 4)).len(), 4 * 4 * 4 - 2 * 2 * 2, "all but the inner cubes");
    }

    #[test]
    fn clusters_are_what_touches() {
        let mut cells = [solid(0, 3), solid(3, 2), solid(6, 2)].concat();
        cells.sort_unstable();
        let (numbers, count) = clusters(&cells);
        assert_eq!(count, 2, "two that touch at a corner, and one apart");
        let of_last = numbers.iter().filter(|&&number| number == 1).count();
        assert_eq!(of_last, 8, "the cubes of the one apart");
    }
}
