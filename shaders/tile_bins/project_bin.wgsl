// project_bin: slices each Gaussian at the view's time, projects it, and puts its splat into the bins that it covers;
// the first pass of tile bins.
// In: Gaussians, an instance, a list of active Gaussians, with OPAQUE the surfaces of `find_surfaces`. Out: splats
// without color, the list of the visible splats, and unordered bins of a few tiles, or if they have no room yet, the
// number of splats of each bin. CPU reference: src/reference/project.rs with src/gaussian/projection.rs.
#import gs4d::types::{SplatShape, VisibleSplat, BIN_COUNTERS, DEBUG_ACTIVE, INVISIBLE}
#import gs4d::bins::{bin_side, depth_order, stamp_bits}
#import gs4d::capture::{index_of, instance, viewing_direction}
#ifdef COPIED_INSTANCE
#import gs4d::capture::instances
#endif
#import gs4d::filling::{begin_filling, bins, count_splat, filling_of, put_splat, put_wide_splats, reserve_entries, Filling, OWN_BINS}
#import gs4d::projection::{debug_color, is_present, projection_of}
#ifdef OPAQUE
#import gs4d::projection::mean_depth
#import gs4d::tile::{pack_tiles, tile_index}
#else
#import gs4d::tile::pack_tiles
#endif

@group(0) @binding(1) var<storage, read_write> splats: array<SplatShape>;
// The visible splats of each part, from its first slot on.
@group(0) @binding(4) var<storage, read_write> visible: array<VisibleSplat>;
#ifdef OPAQUE
// Depth order of the farthest opaque surface of each tile.
@group(0) @binding(5) var<storage, read> tile_surfaces: array<u32>;

// Largest number of tiles of a splat that is left out: a thread tests all of them.
const TESTED_TILES: u32 = 256u;
#endif

// Indices of the workgroup's Gaussians that are present, relative to its first, two per word. The host assigns at most
// four Gaussians to each thread.
var<workgroup> present: array<atomic<u32>, 512>;
var<workgroup> present_count: atomic<u32>;
var<workgroup> own_visible: atomic<u32>;
var<workgroup> own_pairs: atomic<u32>;
// Index in the part's list of the first visible splat of the workgroup.
var<workgroup> visible_before: u32;

#ifdef OPAQUE
// Depth order of the farthest surface of the picture, behind which no Gaussian is projected. The test costs time where
// it leaves out few: NEVER unless the center of the instance is behind that surface.
var<workgroup> hidden_from: u32;
const NEVER: u32 = 0xffffffffu;
// Relative margin of the depth of that test: more than its rounding.
const MARGIN: f32 = 1e-5;

// Returns whether a Gaussian is behind the surfaces of all pixels.
fn is_behind_all(index: u32, farthest: u32) -> bool {
    let depth = mean_depth(index);
    return depth_order(depth - MARGIN * abs(depth)) > farthest;
}

// Returns whether a splat is behind the surfaces of all pixels of its tiles: `blend_blocks` would show it nowhere.
fn is_hidden(tiles: vec4<u32>, key: u32) -> bool {
    let size = tiles.zw - tiles.xy;
    var hidden = size.x * size.y <= TESTED_TILES;
    for (var y = tiles.y; hidden && y < tiles.w; y++) {
        for (var x = tiles.x; hidden && x < tiles.z; x++) {
            hidden = key > tile_surfaces[tile_index(vec2(x, y), instance.tiles.x)];
        }
    }
    return hidden;
}
#endif

// Returns the bins that are filled, each with room for the same number of splats. Without room, splats are only
// counted.
fn filled() -> Filling {
    let capacity = instance.binning.y;
    return filling_of(instance.tiles, bin_side(instance.binning), BIN_COUNTERS + instance.binning.w, capacity, capacity);
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
            atomicStore(&bins[5], 0u);
            atomicStore(&bins[6], 0u);
        }
#ifdef OPAQUE
        let farthest = atomicLoad(&bins[2]);
        hidden_from = select(NEVER, farthest, farthest < depth_order(instance.middle));
#endif
    }
    for (var i = thread; i < 128u * instance.per_thread; i += 256u) {
        atomicStore(&present[i], 0u);
    }
    workgroupBarrier();
#ifdef OPAQUE
    let farthest = workgroupUniformLoad(&hidden_from);
#endif
    // Absent Gaussians are removed first, so that few threads of the projection are idle.
    let first_of_group = group.x * instance.per_thread * 256u;
    for (var i = thread; i < instance.per_thread * 256u; i += 256u) {
        var drawn = first_of_group + i < instance.count && is_present(index_of(first_of_group + i));
#ifdef OPAQUE
        drawn = drawn && (farthest == NEVER || !is_behind_all(index_of(first_of_group + i), farthest));
#endif
        if drawn {
            let place = atomicAdd(&present_count, 1u);
            atomicOr(&present[place / 2u], i << (16u * (place & 1u)));
        }
    }
    let count = workgroupUniformLoad(&present_count);
    for (var first = 0u; first < count; first += 256u) {
        begin_filling(filled(), thread);
        if thread == 0u {
            atomicStore(&own_visible, 0u);
            atomicStore(&own_pairs, 0u);
        }
        workgroupBarrier();
        project_and_bin(first_of_group, first + thread, count, thread);
        workgroupBarrier();
    }
}

// Projects the Gaussian at index `place` of the `count` Gaussians that are present, and writes its splat into its bins.
// All threads of the workgroup must call this function.
fn project_and_bin(first_of_group: u32, place: u32, count: u32, thread: u32) {
    let filling = filled();
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
        key = depth_order(p.depth);
        var is_visible = p.depth_key != INVISIBLE;
#ifdef OPAQUE
        is_visible = is_visible && !is_hidden(p.tiles, key);
#endif
        if is_visible {
            splats[slot] = SplatShape(vec4(p.center, p.opacity, p.depth), vec4(p.conic, 0.0));
            if instance.debug >= DEBUG_ACTIVE {
                seen = vec4(debug_color(p), 0.0);
            } else {
                seen = vec4(viewing_direction(p.gaussian, p.dt), -p.dt);
            }
            covered = p.tiles;
            place_of_visible = atomicAdd(&own_visible, 1u);
            atomicAdd(&own_pairs, (covered.z - covered.x) * (covered.w - covered.y));
        }
    }
    let own_bins = count_splat(filling, covered, key, slot);
    let wide_count = reserve_entries(filling, thread);
    if thread == 0u {
        visible_before = atomicAdd(&bins[BIN_COUNTERS + instance.binning.z], atomicLoad(&own_visible));
        let pairs_of_group = atomicLoad(&own_pairs);
        if atomicAdd(&bins[0], pairs_of_group) > 0xffffffffu - pairs_of_group {
            atomicAdd(&bins[1], 1u);
        }
    }
    workgroupBarrier();
    if covered.z > covered.x {
        let tiles = pack_tiles(covered) | stamp_bits(instance.binning.x >> 8u);
        visible[instance.first_slot + visible_before + place_of_visible] = VisibleSplat(seen, vec4(slot, index, tiles));
    }
    // Without room, the splats have been counted, unless the bins are too many for the counters of the workgroup.
    if filling.room > 0u || filling.count > OWN_BINS {
        put_splat(filling, own_bins, covered, key, slot);
        put_wide_splats(filling, wide_count, thread);
    }
}
