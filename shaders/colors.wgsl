// colors: the colors of the visible splats of one part: the second pass of the fast renderer.
// In: the slots of the visible splats, which `project_bin` listed; Gaussians, color coefficients, an instance. Out: the colors of their
// splats. CPU reference: src/reference/project.rs.
//
// Several threads compute the shares of one color: there are too few visible splats for all threads of a large GPU. Whole coefficients
// are read by neighboring threads, which reads whole lines; those of a codebook by threads far apart, so that neighbors read the
// same scales.
#import gs4d::types::{Gaussian, SplatRecord, BIN_COUNTERS, DEBUG_ACTIVE}
#import gs4d::capture::{index_of, instance, load_gaussian, load_lifespan}
#import gs4d::color::{color_share, finished_color, viewing_direction, SHARES}

const THREADS: u32 = 256u;
// Splats of a workgroup.
const SPLATS: u32 = THREADS / SHARES;

@group(0) @binding(1) var<storage, read_write> splats: array<SplatRecord>;
@group(0) @binding(2) var<storage, read> bins: array<u32>;
@group(0) @binding(3) var<storage, read> visible: array<u32>;

#ifdef CODED_COLORS
const NEXT_SHARE: u32 = SPLATS;
const NEXT_SPLAT: u32 = 1u;
#else
const NEXT_SHARE: u32 = 1u;
const NEXT_SPLAT: u32 = SHARES;
#endif

var<workgroup> shares: array<vec3<f32>, THREADS>;

@compute @workgroup_size(THREADS)
fn colors(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    // The colors of other debug views are those of `project_bin`.
    let count = select(bins[BIN_COUNTERS + instance.binning.z], 0u, instance.debug >= DEBUG_ACTIVE);
    for (var first = group.x * SPLATS; first < count; first += groups.x * SPLATS) {
        let own = first + thread / NEXT_SPLAT % SPLATS;
        let share = thread / NEXT_SHARE % SHARES;
        var slot = 0u;
        if own < count {
            slot = visible[instance.first_slot + own];
            let index = index_of(slot);
            let g = load_gaussian(index);
            let dt = instance.time - load_lifespan(index).x;
            shares[thread] = color_share(share, index, viewing_direction(g, dt), -dt);
        }
        workgroupBarrier();
        if own < count && share == 0u {
            var sum = shares[thread];
            for (var i = 1u; i < SHARES; i++) {
                sum += shares[thread + i * NEXT_SHARE];
            }
            splats[instance.first_slot + slot].color = finished_color(sum);
        }
        workgroupBarrier();
    }
}
