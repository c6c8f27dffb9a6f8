// find_surfaces: finds the farthest opaque surface of each tile, one workgroup per 2 x 2 tiles; before `project_bin`,
// in frames with opaque surfaces.
// In: the depth of opaque surfaces. Out: the depth order of the farthest surface of each tile, by which `project_bin`
// leaves out splats that no pixel of their tiles shows, and of the picture, by which it leaves out Gaussians before it
// projects them.
#import gs4d::bins::depth_order
#ifdef MULTISAMPLED
#import gs4d::pixel::{frame, surface_range}
#else
#import gs4d::pixel::{frame, surface_depth}
#endif
#import gs4d::tile::{pixel_of, tile_index}

const TILES: u32 = 4u;
// Threads and pixels of a tile.
const THREADS: u32 = 64u;
const PIXELS: u32 = 256u;

@group(1) @binding(0) var<storage, read_write> tile_surfaces: array<u32>;
// Counters (see BIN_COUNTERS). The farthest surface of the picture was cleared by `sort_bins` of the previous frame.
@group(1) @binding(1) var<storage, read_write> bins: array<atomic<u32>>;

var<workgroup> farthest: array<atomic<u32>, TILES>;

fn tile_of(group: vec2<u32>, i: u32) -> vec2<u32> {
    return 2u * group + vec2(i & 1u, i >> 1u);
}

@compute @workgroup_size(TILES * THREADS)
fn find_surfaces(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if thread < TILES {
        atomicStore(&farthest[thread], 0u);
    }
    workgroupBarrier();
    let tile = tile_of(group.xy, thread / THREADS);
    var own = 0u;
    for (var i = thread % THREADS; i < PIXELS; i += THREADS) {
        let at = pixel_of(tile, i);
        if all(at < frame.size) {
#ifdef MULTISAMPLED
            own = max(own, depth_order(surface_range(at, true).y));
#else
            own = max(own, depth_order(surface_depth(at, true)));
#endif
        }
    }
    atomicMax(&farthest[thread / THREADS], own);
    workgroupBarrier();
    if thread < TILES {
        let written = tile_of(group.xy, thread);
        if all(written < frame.tiles) {
            tile_surfaces[tile_index(written, frame.tiles.x)] = atomicLoad(&farthest[thread]);
        }
    }
    if thread == 0u {
        // Tiles outside the picture have no pixels, and 0.
        var of_group = 0u;
        for (var i = 0u; i < TILES; i++) {
            of_group = max(of_group, atomicLoad(&farthest[i]));
        }
        // Most workgroups find a number that is large enough already: fewer wait for one another.
        if of_group > atomicLoad(&bins[2]) {
            atomicMax(&bins[2], of_group);
        }
    }
}
