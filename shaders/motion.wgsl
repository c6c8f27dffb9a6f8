// motion: the screen-space motion of each visible splat of one part since the previous frame.
// In: splats, their Gaussians, the view of the previous frame. Out: motions, in pixels to the right and down. They
// overwrite the colors of the splats, which have been blended: the last pass runs again and blends motions as it
// blended colors. CPU reference: src/reference/motion.rs.
#import gs4d::types::MotionUniforms
#import gs4d::capture::{instance, load_gaussian}
#ifdef COPIED_INSTANCE
#import gs4d::capture::instances
#endif
#ifdef BINNED
#import gs4d::types::{SplatShape, VisibleSplat, BIN_COUNTERS}
#else
#import gs4d::types::{SplatRecord, INVISIBLE}
#import gs4d::capture::index_of
#endif

const THREADS: u32 = 256u;

@group(0) @binding(1) var<uniform> before: MotionUniforms;
#ifdef BINNED
@group(0) @binding(2) var<storage, read> bins: array<u32>;
@group(0) @binding(3) var<storage, read> visible: array<VisibleSplat>;
@group(0) @binding(4) var<storage, read> splats: array<SplatShape>;
// Indexed by slot.
@group(0) @binding(5) var<storage, read_write> splat_colors: array<vec4<f32>>;
#else
@group(0) @binding(2) var<storage, read> depth_keys: array<u32>;
@group(0) @binding(3) var<storage, read_write> splats: array<SplatRecord>;
#endif

// Returns the motion of the splat of a Gaussian, given the center of the splat in this frame.
fn motion_of(index: u32, center: vec2<f32>) -> vec2<f32> {
    let g = load_gaussian(index);
    let mean = vec4(g.mean + g.velocity * (before.time - g.mean_t), 1.0);
    let depth = dot(before.camera_z, mean);
    // The negated comparison is true for NaN. A Gaussian in front of the near plane in the previous frame has no motion
    // either.
    if !(depth > before.near) {
        return vec2(0.0);
    }
    let parallel = instance.orthographic != 0u;
    let ndc = vec2(dot(before.clip_x, mean), dot(before.clip_y, mean)) / select(depth + 1e-7, 1.0, parallel);
    let size = vec2<f32>(instance.size);
    // The same formula as in `project`.
    let center_before = ((ndc + 1.0) * size - 1.0) * 0.5;
    // The motion of splats that enter from outside the picture is clamped to the size of the picture.
    return clamp(center - center_before, -size, size);
}

#ifdef BINNED
@compute @workgroup_size(THREADS)
fn motion(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
#ifdef COPIED_INSTANCE
    instance = instances[group.z].uniforms;
#endif
    let count = bins[BIN_COUNTERS + instance.binning.z];
    for (var i = group.x * THREADS + thread; i < count; i += groups.x * THREADS) {
        let words = visible[instance.first_slot + i].words;
        splat_colors[words.x] = vec4(motion_of(words.y, splats[words.x].place.xy), 0.0, 0.0);
    }
}
#else
@compute @workgroup_size(THREADS)
fn motion(@builtin(global_invocation_id) id: vec3<u32>) {
#ifdef COPIED_INSTANCE
    instance = instances[id.z].uniforms;
#endif
    if id.x >= instance.count {
        return;
    }
    let slot = instance.first_slot + id.x;
    if depth_keys[slot] == INVISIBLE {
        return;
    }
    let moved = motion_of(index_of(id.x), splats[slot].place.xy);
    // The last word contains tile coordinates and is unchanged.
    splats[slot].color = vec4(bitcast<vec2<u32>>(moved), 0u, splats[slot].color.w);
}
#endif
