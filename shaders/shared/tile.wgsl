// Overlap of splats and tiles: which tiles a splat covers, and the order of its pairs with them. CPU reference:
// src/gaussian/overlap.rs. Rectangles are x0, y0, x1, y1 with the ends excluded; packed into two words of 16 bits each,
// `low` contains x0 and y0, `high` x1 and y1.
#define_import_path gs4d::tile

#import gs4d::alpha::INVERSE_ALPHA_MIN

// Side of a tile in pixels.
const TILE_SIZE: u32 = 16u;

// Returns the tiles that the original assigns: the tiles of the square of +-`radius` pixels around `center`, clamped to
// the grid.
fn tiles_of(center: vec2<f32>, radius: f32, grid: vec2<f32>) -> vec4<f32> {
    let side = f32(TILE_SIZE);
    let low = clamp(trunc((center - radius) / side), vec2(0.0), grid);
    let high = clamp(trunc((center + radius + (side - 1.0)) / side), vec2(0.0), grid);
    return vec4(low, high);
}

// Returns the part of `tiles` where alpha can reach 1/255, possibly empty; `blend` would skip the splat in the other
// tiles. `variance` is xx and yy of the covariance on the screen.
fn contributing_tiles(
    tiles: vec4<f32>,
    center: vec2<f32>,
    variance: vec2<f32>,
    opacity: f32,
) -> vec4<f32> {
    let energy = energy_of(opacity);
    if energy < -1e-3 {
        return vec4(0.0);
    }
    // Margins for rounding: a thousandth of the size and a hundredth of a pixel.
    let half = sqrt(max(energy, 0.0) * variance) * 1.001 + 0.01;
    let side = f32(TILE_SIZE);
    let low = max(tiles.xy, floor((center - half) / side));
    let high = min(tiles.zw, floor((center + half) / side) + 1.0);
    return vec4(low, high);
}

// Returns the words `low` and `high` of a rectangle.
fn pack_tiles(tiles: vec4<u32>) -> vec2<u32> {
    return tiles.xz | (tiles.yw << vec2(16u));
}

// Returns the rectangle of the words `low` and `high`.
fn unpack_tiles(words: vec2<u32>) -> vec4<u32> {
    return vec4(words & vec2(0xffffu), words >> vec2(16u)).xzyw;
}

// Returns the number of columns of a rectangle.
fn tile_columns(low: u32, high: u32) -> u32 {
    return (high & 0xffffu) - (low & 0xffffu);
}

// Returns the number of tiles of a rectangle, which is the number of pairs of its splat.
fn tile_count(low: u32, high: u32) -> u32 {
    return tile_columns(low, high) * ((high >> 16u) - (low >> 16u));
}

// Returns whether a rectangle contains a tile.
fn covers_tile(low: u32, high: u32, tile: vec2<u32>) -> bool {
    return all(tile >= vec2(low & 0xffffu, low >> 16u)) && all(tile < vec2(high & 0xffffu, high >> 16u));
}

// Returns the tile of pair `k` of a splat: the tiles of its rectangle are ordered row by row.
fn tile_of_pair(low: u32, high: u32, k: u32) -> vec2<u32> {
    let columns = tile_columns(low, high);
    return vec2((low & 0xffffu) + k % columns, (low >> 16u) + k / columns);
}

// Returns the pair of a splat with a tile of its rectangle: the inverse of tile_of_pair.
fn pair_of_tile(low: u32, high: u32, tile: vec2<u32>) -> u32 {
    return (tile.y - (low >> 16u)) * tile_columns(low, high) + tile.x - (low & 0xffffu);
}

// Returns the index of a tile in a grid with `columns` columns, row by row.
fn tile_index(tile: vec2<u32>, columns: u32) -> u32 {
    return tile.y * columns + tile.x;
}

// Returns the pixel of one of the 256 threads of a tile.
fn pixel_of(tile: vec2<u32>, thread: u32) -> vec2<u32> {
    return tile * TILE_SIZE + vec2(thread % TILE_SIZE, thread / TILE_SIZE);
}

// Returns the bound of the quadratic form of a splat within which alpha reaches 1/255.
fn energy_of(opacity: f32) -> f32 {
    return 2.0 * log(opacity * INVERSE_ALPHA_MIN);
}
