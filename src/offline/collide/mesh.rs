//! The surface of a set of cells.
//!
//! In: solid cells, the optical thickness of each cell. Out: closed [`ColliderMesh`]es in capture space, simplified:
//! surface nets, which place one point in each cube between eight centers of cells that are not all alike, where the
//! opacity passes the level. A point lies strictly inside its cube: no two coincide.

use super::solid::Solid;
use crate::scene::ColliderMesh;
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use glam::Vec3;
use meshopt::SimplifyOptions;
use ndshape::RuntimeShape;
use rayon::prelude::*;

/// Largest distance of the opacity from the level that counts: what is far inside or outside does not draw the surface.
const FARTHEST: f32 = 0.5;
/// Smallest: points are not at the center of a cell, where several would coincide.
const NEAREST: f32 = 0.05;
/// The distance at cells that are solid and not opaque enough, or opaque enough and not solid.
const CHANGED: f32 = 0.25;

/// Returns the surface of solid cells, simplified by about the distance `error`, in cells. `thickness` is the optical
/// thickness of each cell of their grid, `level` the opacity at the surface.
pub(super) fn mesh(solid: &Solid, thickness: &[f32], level: f32, error: f32) -> ColliderMesh {
    let Some(span) = solid.span() else { return ColliderMesh::default() };
    let (points, indices) = surface(solid, thickness, level, span);
    let indices = simplified(&points, &indices, error);
    // Indices that are near each other are stored in few bytes.
    let mut indices = meshopt::optimize_vertex_cache(&indices, points.len());
    let points = meshopt::optimize_vertex_fetch(&mut indices, &points);
    let points = points.into_iter().map(|point| solid.grid.place(point.into()).to_array()).collect();
    ColliderMesh { points, triangles: indices.as_chunks().0.to_vec() }
}

/// Returns the points and the triangles of the surface of cells within these coordinates. Lengths are in cells; the
/// center of the first cell of the grid is 0. Triangles are counter-clockwise seen from outside.
fn surface(solid: &Solid, thickness: &[f32], level: f32, [low, high]: [[usize; 3]; 2]) -> (Vec<[f32; 3]>, Vec<u32>) {
    let Solid { grid, cells } = solid;
    // One empty cell before the first and two after the last: surface nets have no faces in the last cubes of a field.
    let size: [usize; 3] = std::array::from_fn(|axis| high[axis] - low[axis] + 4);
    let steps = grid.steps();
    let index = |place: [usize; 3]| {
        let side = |axis: usize| (low[axis] + place[axis]).checked_sub(1).filter(|&side| side < grid.size[axis]);
        Some(side(0)? * steps[0] + side(1)? * steps[1] + side(2)? * steps[2])
    };
    let mut field = vec![0.0f32; size.iter().product()];
    field.par_chunks_mut(size[0]).enumerate().for_each(|(row, values)| {
        let (y, z) = (row % size[1], row / size[1]);
        for (x, value) in values.iter_mut().enumerate() {
            *value = index([x, y, z]).map_or(FARTHEST, |index| distance(cells[index], thickness[index], level));
        }
    });
    let sides = size.map(|side| side as u32);
    let mut net = SurfaceNetsBuffer::default();
    surface_nets(&field, &RuntimeShape::<u32, 3>::new(sides), [0; 3], sides.map(|side| side - 1), &mut net);
    let first = Vec3::from_array(low.map(|side| side as f32)) - 1.0;
    (net.positions.into_iter().map(|point| (first + Vec3::from(point)).to_array()).collect(), net.indices)
}

/// Returns how far the opacity of a cell is from the level, negative if the cell is solid.
fn distance(is_solid: bool, thickness: f32, level: f32) -> f32 {
    // The opacity is 1 − e^−thickness.
    let distance = level + (-thickness).exp_m1();
    match (is_solid, distance < 0.0) {
        (true, true) => distance.clamp(-FARTHEST, -NEAREST),
        (false, false) => distance.clamp(NEAREST, FARTHEST),
        (true, false) => -CHANGED,
        (false, true) => CHANGED,
    }
}

/// Returns the triangles that remain if points are merged with their neighbors: what was closed remains closed. A mesh
/// that would lose half of its volume is not simplified.
fn simplified(points: &[[f32; 3]], indices: &[u32], error: f32) -> Vec<u32> {
    let fewer = meshopt::simplify_decoder(indices, points, 0, error, SimplifyOptions::ErrorAbsolute, None);
    let is_like = volume(points, &fewer) > 0.5 * volume(points, indices);
    if is_like { fewer } else { indices.to_vec() }
}

/// Returns the volume inside a closed mesh.
fn volume(points: &[[f32; 3]], indices: &[u32]) -> f64 {
    let triangles: &[[u32; 3]] = indices.as_chunks().0;
    let origin = points.first().copied().unwrap_or_default();
    let corner = |index: u32| (Vec3::from(points[index as usize]) - Vec3::from(origin)).as_dvec3();
    let six = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(corner);
        a.dot(b.cross(c))
    };
    triangles.iter().map(six).sum::<f64>() / 6.0
}

#[cfg(test)]
mod tests {
    use super::super::grid::Grid;
    use super::*;
    use glam::DVec3;
    use std::collections::BTreeMap;
    use std::f32::consts::LN_2;
    use std::f64::consts::PI;

    /// Radius of the ball, cells.
    const RADIUS: f32 = 8.0;
    const CELL: f32 = 0.1;

    /// Returns a ball with a soft surface, and its optical thickness.
    fn ball() -> (Solid, Vec<f32>) {
        let grid = Grid { low: DVec3::new(1.0, 2.0, 3.0), cell: CELL.into(), size: [24, 25, 26] };
        let thick = |index: usize| {
            let place = Vec3::from_array(grid.coordinates(index).map(|side| side as f32));
            let inside = RADIUS - place.distance(Vec3::new(11.3, 11.8, 12.1));
            -(1.0 - (0.5 + 0.5 * inside).clamp(0.0, 0.99)).ln()
        };
        let thickness: Vec<f32> = (0..grid.len()).map(thick).collect();
        (Solid::of(grid, &thickness, LN_2).joined(|index| thickness[index]), thickness)
    }

    fn volume_of(mesh: &ColliderMesh) -> f64 {
        volume(&mesh.points, mesh.triangles.as_flattened())
    }

    /// Returns how many triangles have each edge, in this direction.
    fn edges(triangles: &[[u32; 3]]) -> BTreeMap<[u32; 2], usize> {
        let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for &[a, b, c] in triangles {
            for edge in [[a, b], [b, c], [c, a]] {
                *edges.entry(edge).or_default() += 1;
            }
        }
        edges
    }

    fn is_closed(triangles: &[[u32; 3]]) -> bool {
        let edges = edges(triangles);
        edges.iter().all(|([a, b], count)| a != b && edges.get(&[*b, *a]) == Some(count))
    }

    #[test]
    fn the_mesh_of_a_ball_has_its_volume_and_its_front_outside() {
        let (solid, thickness) = ball();
        let expected = 4.0 / 3.0 * PI * f64::from(RADIUS * CELL).powi(3);
        let whole = mesh(&solid, &thickness, 0.5, 0.0);
        let part = volume_of(&whole) / expected;
        assert!((part - 1.0).abs() < 0.1, "it has {part} of the volume of the ball");
        let center = Vec3::new(1.0, 2.0, 3.0) + CELL * (Vec3::new(11.3, 11.8, 12.1) + 0.5);
        for point in &whole.points {
            let off = center.distance(Vec3::from(*point)) / CELL - RADIUS;
            assert!(off.abs() < 0.3, "{point:?} is {off} cells off the surface");
        }
        assert!(is_closed(&whole.triangles), "it is closed");
        let simple = mesh(&solid, &thickness, 0.5, 0.5);
        let part = volume_of(&simple) / expected;
        assert!((part - 1.0).abs() < 0.2, "simplified it has {part} of the volume of the ball");
        let counts = [&simple, &whole].map(|mesh| mesh.triangles.len());
        assert!(2 * counts[0] < counts[1], "it has fewer triangles: {counts:?}");
        assert!(is_closed(&simple.triangles), "it remains closed");
        let used = simple.triangles.as_flattened().iter().max().map(|&index| index as usize + 1);
        assert_eq!(used, Some(simple.points.len()), "it has no points without triangles");
    }

    #[test]
    fn every_edge_of_a_surface_belongs_to_two_triangles() {
        let (ball, thickness) = ball();
        let rough = Solid::in_size([9, 9, 9], |[x, y, z]| (x * x * 5 + y * y * 7 + z * z * 11 + x * y * z) % 6 == 0);
        let rough = rough.joined(|index| (index % 5) as f32);
        let whole = Solid::in_size([6, 6, 6], |_| true);
        for (solid, thickness) in [(ball, thickness), (rough, vec![1.0; 729]), (whole, vec![9.0; 216])] {
            let span = solid.span().expect("it has cells");
            let (_, indices) = surface(&solid, &thickness, 0.5, span);
            let triangles: &[[u32; 3]] = indices.as_chunks().0;
            assert!(!triangles.is_empty(), "it has a surface");
            assert!(is_closed(triangles), "it is closed, at the sides of the grid, too");
            assert!(edges(triangles).values().all(|&count| count == 1), "two triangles at each edge");
        }
    }

    #[test]
    fn what_the_grid_cuts_ends_with_the_grid() {
        let whole = Solid::in_size([6, 6, 6], |_| true);
        let cut = mesh(&whole, &[9.0; 216], 0.5, 0.0);
        let part = volume_of(&cut) / 216.0;
        assert!((0.9..=1.0).contains(&part), "a cube without its edges, {part} of its volume");
        assert!(cut.points.iter().flatten().all(|side| (-1e-3..6.001).contains(side)), "within the grid");
    }

    #[test]
    fn the_surface_passes_where_the_opacity_passes_the_level_unless_cells_are_changed() {
        assert!((distance(true, 1.0, 0.5) + 0.132).abs() < 1e-3, "an opacity of 0.632");
        assert!((distance(false, 0.2, 0.5) - 0.319).abs() < 1e-3, "an opacity of 0.181");
        assert_eq!([distance(true, 9.0, 0.3), distance(false, 0.0, 0.9)], [-0.5, 0.5], "at most by a half");
        assert_eq!(distance(true, LN_2 + 1e-4, 0.5), -NEAREST, "at least by a little");
        assert_eq!(distance(true, 0.0, 0.5), -CHANGED, "a cell that was filled");
        assert_eq!(distance(false, 9.0, 0.5), CHANGED, "a cell that was taken out");
    }

    #[test]
    fn what_is_small_is_not_simplified_away() {
        let one = Solid::in_size([5, 5, 5], |place| place == [2, 2, 2]);
        let thickness: Vec<f32> = one.cells.iter().map(|&cell| if cell { 9.0 } else { 0.0 }).collect();
        let small = mesh(&one, &thickness, 0.5, 4.0);
        assert!(volume_of(&small) > 0.01, "a cell has a volume, although its size is below the error: {small:?}");
        let none = Solid::in_size([5, 5, 5], |_| false);
        assert!(mesh(&none, &thickness, 0.5, 0.5).is_empty(), "nothing has no surface");
    }
}
