// find_surfaces: finds the farthest opaque surface of each tile, one workgroup per tile; before `project_bin`, in frames behind surfaces.
// In: the depth of opaque surfaces. Out: the depth order of the farthest surface of each tile, by which `project_bin` leaves out splats that
// no pixel of their tiles shows, and of the picture, by which it leaves out whole instances.
#import gs4d::bins::depth_order
#ifdef MULTISAMPLED
#import gs4d::pixel::{frame, surface_range}
#else
#import gs4d::pixel::{frame, surface_depth}
#endif
#import gs4d::tile::{pixel_of, tile_index}

const THREADS: u32 = 64u;
const PIXELS: u32 = 256u;

@group(1) @binding(0) var<storage, read_write> tile_surfaces: array<u32>;
// Counters (see BIN_COUNTERS). The farthest surface of the picture was cleared by `sort_bins` of the previous frame.
@group(1) @binding(1) var<storage, read_write> bins: array<atomic<u32>>;

var<workgroup> farthest: atomic<u32>;

@compute @workgroup_size(THREADS)
fn find_surfaces(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if thread == 0u {
        atomicStore(&farthest, 0u);
    }
    workgroupBarrier();
    var own = 0u;
    for (var i = thread; i < PIXELS; i += THREADS) {
        let at = pixel_of(group.xy, i);
        if all(at < frame.size) {
#ifdef MULTISAMPLED
            own = max(own, depth_order(surface_range(at, true).y));
#else
            own = max(own, depth_order(surface_depth(at, true)));
#endif
        }
    }
    atomicMax(&farthest, own);
    workgroupBarrier();
    if thread == 0u {
        let of_tile = atomicLoad(&farthest);
        tile_surfaces[tile_index(group.xy, frame.tiles.x)] = of_tile;
        atomicMax(&bins[2], of_tile);
    }
}
