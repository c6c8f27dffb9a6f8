//! Overlap of splats and tiles: which tiles a splat covers, and the order of its pairs with them.
//!
//! In: center, size and opacity of a splat on the screen, and the grid of tiles. Out: [`TileRect`], the tiles in it,
//! and their index in the grid. The CPU reference of `shaders/shared/tile.wgsl`.

use super::alpha::reach_squared;
use crate::view::TILE_SIZE;
use glam::{UVec2, Vec2, Vec3};

/// A rectangle of tiles; empty unless [`high`](Self::high) is beyond [`low`](Self::low) on both axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileRect {
    /// First column and row.
    pub low: UVec2,
    /// Column and row after the last.
    pub high: UVec2,
}

impl TileRect {
    /// The empty rectangle.
    pub const EMPTY: Self = Self { low: UVec2::ZERO, high: UVec2::ZERO };

    /// Returns whether there is no tile in it.
    pub fn is_empty(self) -> bool {
        self.high.cmple(self.low).any()
    }

    /// Returns the number of tiles in it, which is the number of pairs of its splat.
    pub fn count(self) -> u32 {
        self.high.x.saturating_sub(self.low.x) * self.high.y.saturating_sub(self.low.y)
    }

    /// Returns its tiles row by row, the order of the pairs of its splat.
    pub fn tiles(self) -> impl Iterator<Item = UVec2> {
        let Self { low, high } = self;
        (low.y..high.y).flat_map(move |y| (low.x..high.x).map(move |x| UVec2::new(x, y)))
    }

    /// Returns x0, y0, x1, y1, ends excluded.
    pub fn to_array(self) -> [u32; 4] {
        [self.low.x, self.low.y, self.high.x, self.high.y]
    }
}

/// Returns the tiles that the original assigns: those of the square of ±`radius` pixels around `center` (pixels),
/// clamped to the grid. Division truncates as in C.
pub fn tiles_of(center: Vec2, radius: f32, grid: UVec2) -> TileRect {
    let grid = grid.as_vec2();
    let side = TILE_SIZE as f32;
    let low = ((center - radius) / side).trunc().clamp(Vec2::ZERO, grid);
    let high = ((center + radius + (side - 1.0)) / side).trunc().clamp(Vec2::ZERO, grid);
    TileRect { low: low.as_uvec2(), high: high.as_uvec2() }
}

/// Returns the part of `tiles` where alpha can reach 1/255, empty if it never does. `center` is in pixels, `covariance`
/// on the screen (xx, xy, yy) in pixels squared.
///
/// [`reach_squared`] gives an ellipse `dᵀ conic d ≤ e`, whose bounding box is `|dx| ≤ sqrt(e · xx)`,
/// `|dy| ≤ sqrt(e · yy)`. Omitting the other tiles changes no pixel: `blend` would skip the splat there.
pub fn contributing_tiles(tiles: TileRect, center: Vec2, covariance: Vec3, opacity: f32) -> TileRect {
    let Vec3 { x: xx, z: yy, .. } = covariance;
    let energy = reach_squared(opacity);
    if energy < -1e-3 {
        return TileRect::EMPTY;
    }
    // Margins for rounding: a thousandth of the size and a hundredth of a pixel.
    let half = (energy.max(0.0) * Vec2::new(xx, yy)).sqrt() * 1.001 + 0.01;
    let side = TILE_SIZE as f32;
    let low = ((center - half) / side).floor().max(Vec2::ZERO);
    let high = (((center + half) / side).floor() + 1.0).max(Vec2::ZERO);
    TileRect { low: tiles.low.max(low.as_uvec2()), high: tiles.high.min(high.as_uvec2()) }
}

/// Returns the index of a tile in a grid of that many tiles across and down, row by row.
pub fn tile_index(tile: UVec2, grid: UVec2) -> u32 {
    tile.y * grid.x + tile.x
}

/// Returns the tile at an index of the grid: the inverse of [`tile_index`].
pub fn tile_at(index: u32, grid: UVec2) -> UVec2 {
    UVec2::new(index % grid.x, index / grid.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::alpha::alpha_at;
    use crate::gaussian::conic::ScreenCovariance;

    #[test]
    fn rectangles_count_and_list_their_tiles() {
        let rect = TileRect { low: UVec2::new(2, 1), high: UVec2::new(4, 3) };
        let tiles: Vec<UVec2> = rect.tiles().collect();
        assert_eq!(tiles, [[2, 1], [3, 1], [2, 2], [3, 2]].map(UVec2::from), "row by row");
        assert_eq!(rect.count(), 4, "the count is the number of listed tiles");
        let grid = UVec2::new(5, 3);
        for tile in tiles {
            assert_eq!(tile_at(tile_index(tile, grid), grid), tile, "the tile follows from its index");
        }
        for empty in [TileRect::EMPTY, TileRect { low: UVec2::new(3, 0), high: UVec2::new(2, 4) }] {
            assert!(empty.is_empty() && empty.count() == 0 && empty.tiles().next().is_none(), "{empty:?} is empty");
        }
    }

    #[test]
    fn omitted_tiles_have_no_visible_pixel() {
        let (center, grid) = (Vec2::new(61.3, 40.9), UVec2::splat(8));
        let square = tiles_of(center, 60.0, grid);
        for covariance in [Vec3::new(9.0, 0.0, 9.0), Vec3::new(400.0, -90.0, 30.0), Vec3::new(0.5, 0.1, 120.0)] {
            let Vec3 { x: xx, y: xy, z: yy } = covariance;
            let conic = ScreenCovariance { entries: covariance, determinant: xx * yy - xy * xy }.conic();
            for opacity in [0.003, 0.005, 0.1, 1.0] {
                let part = contributing_tiles(square, center, covariance, opacity);
                assert!(part.count() < square.count(), "some tiles are omitted at opacity {opacity}");
                assert_eq!(part.is_empty(), opacity < 0.0039, "without tiles exactly if the opacity is below 1/255");
                let inside = |tile: UVec2| tile.cmpge(part.low).all() && tile.cmplt(part.high).all();
                for tile in square.tiles().filter(|&tile| !inside(tile)) {
                    let pixels = (0..TILE_SIZE * TILE_SIZE).map(|i| tile_at(i, UVec2::splat(TILE_SIZE)));
                    for pixel in pixels.map(|within| tile * TILE_SIZE + within) {
                        let alpha = alpha_at(conic, opacity, center - pixel.as_vec2());
                        assert_eq!(alpha, None, "the splat is skipped at pixel {pixel}, at opacity {opacity}");
                    }
                }
            }
        }
    }
}
