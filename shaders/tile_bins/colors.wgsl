// colors: the colors of the visible splats of one part; the third pass of tile bins.
// In: the visible splats, which `project_bin` listed; color coefficients, an instance. Out: the colors of the splats.
// CPU reference: src/reference/project.rs.
//
// SHARES neighboring threads compute the partial sums (shares) of one color: there are too few visible splats to occupy
// all threads of a large GPU, and the coefficients that these threads read are contiguous.
#import gs4d::types::{VisibleSplat, BIN_COUNTERS, DEBUG_ACTIVE}
#import gs4d::capture::instance
#ifdef COPIED_INSTANCE
#import gs4d::capture::instances
#endif
#import gs4d::color::{color_share, finished_color, SHARES}

#ifdef CODED_COLORS
// Each thread waits for many codebook values: a smaller workgroup is scheduled earlier while `sort_bins` runs.
const THREADS: u32 = 128u;
#else
const THREADS: u32 = 256u;
#endif
// Splats of a workgroup.
const SPLATS: u32 = THREADS / SHARES;

@group(0) @binding(1) var<storage, read> bins: array<u32>;
@group(0) @binding(2) var<storage, read> visible: array<VisibleSplat>;
// Indexed by slot.
@group(0) @binding(3) var<storage, read_write> splat_colors: array<vec4<f32>>;

var<workgroup> shares: array<vec3<f32>, THREADS>;

@compute @workgroup_size(THREADS)
fn colors(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
#ifdef COPIED_INSTANCE
    instance = instances[group.z].uniforms;
#endif
    let count = bins[BIN_COUNTERS + instance.binning.z];
    for (var first = group.x * SPLATS; first < count; first += groups.x * SPLATS) {
        let own = first + thread / SHARES;
        let share = thread % SHARES;
        var slot = 0u;
        var seen: vec3<f32>;
        if own < count {
            let splat = visible[instance.first_slot + own];
            slot = splat.words.x;
            seen = splat.seen.xyz;
            shares[thread] = color_share(share, splat.words.y, seen, splat.seen.w);
        }
        workgroupBarrier();
        if own < count && share == 0u {
            var sum = shares[thread];
            for (var i = 1u; i < SHARES; i++) {
                sum += shares[thread + i];
            }
            // In some debug views `project_bin` computes the colors.
            splat_colors[slot] = vec4(select(finished_color(sum), seen, instance.debug >= DEBUG_ACTIVE), 0.0);
        }
        workgroupBarrier();
    }
}
