// Filling of bins with splats, by workgroups of 256 threads. A workgroup counts its splats of each bin in workgroup
// memory, and reserves entries for all of them at once.
// In: a splat for each thread. Out: entries of bins, in no order.
//
//     begin_filling(filling, thread);
//     workgroupBarrier();
//     let own = count_splat(filling, tiles, key, slot);
//     let wide_count = reserve_entries(filling, thread);
//     workgroupBarrier();
//     put_splat(filling, own, tiles, key, slot);
//     put_wide_splats(filling, wide_count, thread);
//
// Every thread of the workgroup must call these functions; a thread without a splat has empty `tiles`.
#define_import_path gs4d::filling

#import gs4d::bins::{bin_grid, entry_word}
#import gs4d::tile::{pack_tiles, unpack_tiles}

// Counters (see BIN_COUNTERS), the number of visible splats of each part, the number of splats of each bin, the place
// of each bin.
@group(0) @binding(2) var<storage, read_write> bins: array<atomic<u32>>;
// Bin by bin: the depth key of a splat, and a word with its slot and the tiles of the bin that it covers.
@group(0) @binding(3) var<storage, read_write> bin_entries: array<vec2<u32>>;

// Bins whose splats a workgroup counts in workgroup memory. Fewer counters allow more workgroups to run at the same
// time.
#ifdef FEW_BINS
const OWN_BINS: u32 = 512u;
#else
const OWN_BINS: u32 = 2048u;
#endif
// Largest number of bins into which a single thread puts its splat, unless `wide` is full.
const OWN_ENTRIES: u32 = 16u;
const WIDE: u32 = 64u;

// Splats of the workgroup in each bin, then the index of the next entry.
var<workgroup> own: array<atomic<u32>, OWN_BINS>;
// Splats in more than OWN_ENTRIES bins, at most WIDE, which all threads put into bins together: tiles, depth key and
// slot.
var<workgroup> wide: array<vec4<u32>, WIDE>;
var<workgroup> wide_listed: atomic<u32>;

// The bins of a picture, and where their entries are.
struct Filling {
    // Tiles along each side of a bin, bins across the picture, all bins.
    side: u32,
    across: u32,
    count: u32,
    // Index in `bins` of the number of entries that are reserved in the first bin.
    first: u32,
    // Entries from the first of a bin to the first of the next, and the number from which on entries are not written.
    stride: u32,
    room: u32,
}

fn filling_of(tiles: vec2<u32>, side: u32, first: u32, stride: u32, room: u32) -> Filling {
    let grid = bin_grid(tiles, side);
    return Filling(side, grid.x, grid.x * grid.y, first, stride, room);
}

// Returns the first bin and the last + 1 of a rectangle of tiles.
fn bins_of(filling: Filling, tiles: vec4<u32>) -> vec4<u32> {
    return vec4(tiles.xy, tiles.zw + filling.side - 1u) / filling.side;
}

// Clears the counters of the workgroup.
fn begin_filling(filling: Filling, thread: u32) {
    for (var i = thread; i < min(filling.count, OWN_BINS); i += 256u) {
        atomicStore(&own[i], 0u);
    }
    if thread == 0u {
        atomicStore(&wide_listed, 0u);
    }
}

// Counts a splat in its bins. Returns the bins into which its thread puts it.
fn count_splat(filling: Filling, tiles: vec4<u32>, key: u32, slot: u32) -> vec4<u32> {
    let b = bins_of(filling, tiles);
    if (b.z - b.x) * (b.w - b.y) > OWN_ENTRIES {
        let place = atomicAdd(&wide_listed, 1u);
        if place < WIDE {
            wide[place] = vec4(pack_tiles(tiles), key, slot);
            return vec4(0u);
        }
    }
    if filling.count <= OWN_BINS {
        for (var y = b.y; y < b.w; y++) {
            for (var x = b.x; x < b.z; x++) {
                atomicAdd(&own[y * filling.across + x], 1u);
            }
        }
    }
    return b;
}

// Reserves entries for the splats that the workgroup has counted. Returns how many of them all threads put into bins
// together.
fn reserve_entries(filling: Filling, thread: u32) -> u32 {
    let wide_count = min(workgroupUniformLoad(&wide_listed), WIDE);
    let by_group = filling.count <= OWN_BINS;
    if wide_count > 0u {
        for (var i = 0u; by_group && i < wide_count; i++) {
            let b = bins_of(filling, unpack_tiles(wide[i].xy));
            for (var k = thread; k < (b.z - b.x) * (b.w - b.y); k += 256u) {
                atomicAdd(&own[(b.y + k / (b.z - b.x)) * filling.across + b.x + k % (b.z - b.x)], 1u);
            }
        }
        workgroupBarrier();
    }
    for (var i = thread; by_group && i < filling.count; i += 256u) {
        let many = atomicLoad(&own[i]);
        if many > 0u {
            atomicStore(&own[i], atomicAdd(&bins[filling.first + i], many));
        }
    }
    return wide_count;
}

// Writes a splat into one of its bins. If the bins are too many for the counters of the workgroup, an entry is reserved
// first.
fn put_in_bin(filling: Filling, x: u32, y: u32, tiles: vec4<u32>, key: u32, slot: u32) {
    let bin = y * filling.across + x;
    var place = 0u;
    if filling.count <= OWN_BINS {
        place = atomicAdd(&own[bin], 1u);
    } else {
        place = atomicAdd(&bins[filling.first + bin], 1u);
    }
    if place < filling.room {
        let corner = filling.side * vec2(x, y);
        let first = max(tiles.xy, corner) - corner;
        let last = min(tiles.zw, corner + filling.side) - 1u - corner;
        bin_entries[bin * filling.stride + place] = vec2(key, entry_word(slot, first, last));
    }
}

// Writes a splat into the bins `b` that `count_splat` returned.
fn put_splat(filling: Filling, b: vec4<u32>, tiles: vec4<u32>, key: u32, slot: u32) {
    for (var y = b.y; y < b.w; y++) {
        for (var x = b.x; x < b.z; x++) {
            put_in_bin(filling, x, y, tiles, key, slot);
        }
    }
}

// Writes the splats that all threads put into bins together.
fn put_wide_splats(filling: Filling, wide_count: u32, thread: u32) {
    for (var i = 0u; i < wide_count; i++) {
        let tiles = unpack_tiles(wide[i].xy);
        let b = bins_of(filling, tiles);
        for (var k = thread; k < (b.z - b.x) * (b.w - b.y); k += 256u) {
            put_in_bin(filling, b.x + k % (b.z - b.x), b.y + k / (b.z - b.x), tiles, wide[i].z, wide[i].w);
        }
    }
}
