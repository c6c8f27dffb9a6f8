// project_bin: slices each Gaussian at the view's time, projects it, and puts its splat into the bins that it covers; the first pass of tile bins.
// In: Gaussians, an instance, a list of active Gaussians. Out: splats without color, the list of the visible splats, and unordered bins of a
// few tiles. CPU reference: src/reference/project.rs with src/gaussian/projection.rs.
#import gs4d::types::{SplatShape, VisibleSplat, BIN_COUNTERS, DEBUG_ACTIVE, INVISIBLE}
#import gs4d::bins::{depth_order, entry_word, stamp}
#import gs4d::capture::{index_of, instance, viewing_direction}
#ifdef COPIED_INSTANCE
#import gs4d::capture::instances
#endif
#import gs4d::projection::{debug_color, is_present, projection_of}
#import gs4d::tile::pack_tiles

@group(0) @binding(1) var<storage, read_write> splats: array<SplatShape>;
// Counters (see BIN_COUNTERS), then the number of visible splats of each part, then the number of splats of each bin.
@group(0) @binding(2) var<storage, read_write> bins: array<atomic<u32>>;
// Bin by bin: the depth key of a splat, and a word with its slot and the tiles of the bin that it covers.
@group(0) @binding(3) var<storage, read_write> bin_entries: array<vec2<u32>>;
// The visible splats of each part, from its first slot on.
@group(0) @binding(4) var<storage, read_write> visible: array<VisibleSplat>;

// Bins whose splats a workgroup counts in workgroup memory before it reserves entries for all of them at once. Fewer counters allow more
// workgroups to run at the same time.
#ifdef FEW_BINS
const OWN_BINS: u32 = 512u;
#else
const OWN_BINS: u32 = 2048u;
#endif
// Largest number of bins into which a single thread writes its splat, unless `wide` is full.
const OWN_ENTRIES: u32 = 16u;
const WIDE: u32 = 64u;

// Indices of the workgroup's Gaussians that are present, relative to its first, two per word. The host assigns at most four Gaussians to
// each thread.
var<workgroup> present: array<atomic<u32>, 512>;
var<workgroup> present_count: atomic<u32>;
var<workgroup> own: array<atomic<u32>, OWN_BINS>;
var<workgroup> own_visible: atomic<u32>;
var<workgroup> own_pairs: atomic<u32>;
// Splats in more than OWN_ENTRIES bins, at most WIDE, which all threads write into bins together: tiles, depth key and slot.
var<workgroup> wide: array<vec4<u32>, WIDE>;
var<workgroup> wide_count: atomic<u32>;
// Index in the part's list of the first visible splat of the workgroup.
var<workgroup> visible_before: u32;

// Returns the number of tiles along each side of a bin.
fn side() -> u32 {
    return instance.binning.x & 0xffu;
}

// Returns the number of bins across and down the picture.
fn bin_grid() -> vec2<u32> {
    return (instance.tiles + side() - 1u) / side();
}

// Returns the index of the counter of the first bin.
fn first_bin() -> u32 {
    return BIN_COUNTERS + instance.binning.w;
}

// Returns the first bin and the last + 1 of a rectangle of tiles.
fn bins_of(tiles: vec4<u32>) -> vec4<u32> {
    return vec4(tiles.xy, tiles.zw + side() - 1u) / side();
}

// Writes a splat into one of its bins. `by_group`: the workgroup has reserved entries for its splats; otherwise one entry is reserved now.
fn put_in_bin(x: u32, y: u32, tiles: vec4<u32>, key: u32, slot: u32, by_group: bool) {
    let bin = y * bin_grid().x + x;
    let capacity = instance.binning.y;
    var place = 0u;
    if by_group {
        place = atomicAdd(&own[bin], 1u);
    } else {
        place = atomicAdd(&bins[first_bin() + bin], 1u);
    }
    if place < capacity {
        let corner = side() * vec2(x, y);
        let first = max(tiles.xy, corner) - corner;
        let last = min(tiles.zw, corner + side()) - 1u - corner;
        bin_entries[bin * capacity + place] = vec2(key, entry_word(slot, first, last));
    }
}

// Clears the counters of a workgroup.
fn clear_own(thread: u32) {
    let grid = bin_grid();
    for (var i = thread; i < min(grid.x * grid.y, OWN_BINS); i += 256u) {
        atomicStore(&own[i], 0u);
    }
    if thread == 0u {
        atomicStore(&own_visible, 0u);
        atomicStore(&own_pairs, 0u);
        atomicStore(&wide_count, 0u);
    }
}

@compute @workgroup_size(256)
fn project_bin(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
#ifdef COPIED_INSTANCE
    instance = instances[group.z].uniforms;
#endif
    if thread == 0u {
        atomicStore(&present_count, 0u);
        // `sort_bins` of the next frame counts from 0.
        if group.x == 0u {
            atomicStore(&bins[4], 0u);
            atomicStore(&bins[5], 0u);
        }
    }
    for (var i = thread; i < 128u * instance.per_thread; i += 256u) {
        atomicStore(&present[i], 0u);
    }
    workgroupBarrier();
    // Absent Gaussians are removed first, so that few threads of the projection are idle.
    let first_of_group = group.x * instance.per_thread * 256u;
    for (var i = thread; i < instance.per_thread * 256u; i += 256u) {
        if first_of_group + i < instance.count && is_present(index_of(first_of_group + i)) {
            let place = atomicAdd(&present_count, 1u);
            atomicOr(&present[place / 2u], i << (16u * (place & 1u)));
        }
    }
    let count = workgroupUniformLoad(&present_count);
    for (var first = 0u; first < count; first += 256u) {
        clear_own(thread);
        workgroupBarrier();
        project_and_bin(first_of_group, first + thread, count, thread);
        workgroupBarrier();
    }
}

// Projects the Gaussian at index `place` of the `count` Gaussians that are present, and writes its splat into its bins. All threads of the
// workgroup must call this function.
fn project_and_bin(first_of_group: u32, place: u32, count: u32, thread: u32) {
    let grid = bin_grid();
    let across = grid.x;
    let bin_count = grid.x * grid.y;
    let by_group = bin_count <= OWN_BINS;
    // First and last + 1 tile, and `seen` of VisibleSplat.
    var covered = vec4(0u);
    var seen = vec4(0.0);
    var key = 0u;
    var slot = 0u;
    var index = 0u;
    var place_of_visible = 0u;
    if place < count {
        let i = first_of_group + ((atomicLoad(&present[place / 2u]) >> (16u * (place & 1u))) & 0xffffu);
        slot = instance.first_slot + i;
        index = index_of(i);
        let p = projection_of(index);
        if p.depth_key != INVISIBLE {
            splats[slot] = SplatShape(vec4(p.center, p.opacity, p.depth), vec4(p.conic, 0.0));
            if instance.debug >= DEBUG_ACTIVE {
                seen = vec4(debug_color(p), 0.0);
            } else {
                seen = vec4(viewing_direction(p.gaussian, p.dt), -p.dt);
            }
            covered = p.tiles;
            place_of_visible = atomicAdd(&own_visible, 1u);
            atomicAdd(&own_pairs, (covered.z - covered.x) * (covered.w - covered.y));
            key = depth_order(p.depth);
        }
    }
    var own_bins = bins_of(covered);
    if (own_bins.z - own_bins.x) * (own_bins.w - own_bins.y) > OWN_ENTRIES {
        let wide_place = atomicAdd(&wide_count, 1u);
        if wide_place < WIDE {
            wide[wide_place] = vec4(covered.xy | (covered.zw << vec2(16u)), key, slot);
            own_bins = vec4(0u);
        }
    }
    if by_group {
        for (var y = own_bins.y; y < own_bins.w; y++) {
            for (var x = own_bins.x; x < own_bins.z; x++) {
                atomicAdd(&own[y * across + x], 1u);
            }
        }
    }
    let wide_ones = min(workgroupUniformLoad(&wide_count), WIDE);
    if by_group && wide_ones > 0u {
        for (var i = 0u; i < wide_ones; i++) {
            let b = bins_of(vec4(wide[i].xy & vec2(0xffffu), wide[i].xy >> vec2(16u)));
            for (var k = thread; k < (b.z - b.x) * (b.w - b.y); k += 256u) {
                atomicAdd(&own[(b.y + k / (b.z - b.x)) * across + b.x + k % (b.z - b.x)], 1u);
            }
        }
        workgroupBarrier();
    }
    if thread == 0u {
        visible_before = atomicAdd(&bins[BIN_COUNTERS + instance.binning.z], atomicLoad(&own_visible));
        let pairs_of_group = atomicLoad(&own_pairs);
        if atomicAdd(&bins[0], pairs_of_group) > 0xffffffffu - pairs_of_group {
            atomicAdd(&bins[1], 1u);
        }
    }
    for (var i = thread; i < min(bin_count, OWN_BINS); i += 256u) {
        let many = atomicLoad(&own[i]);
        if many > 0u {
            atomicStore(&own[i], atomicAdd(&bins[first_bin() + i], many));
        }
    }
    workgroupBarrier();
    if covered.z > covered.x {
        let tiles = pack_tiles(covered) | stamp(instance.binning.x >> 8u);
        visible[instance.first_slot + visible_before + place_of_visible] = VisibleSplat(seen, vec4(slot, index, tiles));
    }
    for (var y = own_bins.y; y < own_bins.w; y++) {
        for (var x = own_bins.x; x < own_bins.z; x++) {
            put_in_bin(x, y, covered, key, slot, by_group);
        }
    }
    for (var i = 0u; i < wide_ones; i++) {
        let splat = wide[i];
        let tiles = vec4(splat.xy & vec2(0xffffu), splat.xy >> vec2(16u));
        let b = bins_of(tiles);
        for (var k = thread; k < (b.z - b.x) * (b.w - b.y); k += 256u) {
            put_in_bin(b.x + k % (b.z - b.x), b.y + k / (b.z - b.x), tiles, splat.z, splat.w, by_group);
        }
    }
}
