// project: slices each Gaussian at the view's time and projects it, as the original rasterizer does.
// In: Gaussians, color coefficients, an instance, a list of active Gaussians. Out: one splat and one depth key for each
// active Gaussian; the key of an invisible splat is INVISIBLE. CPU reference: src/reference/project.rs with
// src/gaussian/projection.rs.
#import gs4d::types::{Gaussian, InstanceUniforms, SplatRecord, BIN_COUNTERS, INVISIBLE}
#import gs4d::types::{DEBUG_ACTIVE, DEBUG_LIFESPAN, DEBUG_VELOCITY}
#import gs4d::appearance::{heat, lit}
#import gs4d::tile::{contributing_tiles, pack_tiles, tiles_of}
#ifdef PACKED_GEOMETRY
#import gs4d::packed::{unpack_base, unpack_gaussian, BLOCK_RANGES, PACKED_BLOCK, SHARED_RANGES}
#endif
#import gs4d::harmonics::{basis_first, basis_second, basis_third, basis_fourth, time_cosine}

const MARGINAL_CUTOFF: f32 = 0.05;
const LOW_PASS: f32 = 0.3;
const FRUSTUM_CLAMP: f32 = 1.3;

@group(0) @binding(0) var<uniform> instance: InstanceUniforms;
@group(0) @binding(1) var<storage, read_write> splats: array<SplatRecord>;
#ifdef BINNED
// Counters, see BIN_COUNTERS; then the number of splats of each bin.
@group(0) @binding(2) var<storage, read_write> bins: array<atomic<u32>>;
// Bin by bin: the tiles that a splat covers (bit 4 y + x of the bin's 4 x 4), and its slot.
@group(0) @binding(3) var<storage, read_write> bin_entries: array<vec2<u32>>;
#else
@group(0) @binding(2) var<storage, read_write> depth_keys: array<u32>;
#endif
#ifdef PACKED_GEOMETRY
// Two four-vectors for each Gaussian.
@group(1) @binding(0) var<storage, read> records: array<vec4<u32>>;
@group(1) @binding(1) var<storage, read> ranges: array<vec4<f32>>;
#ifdef CODED_COLORS
// Three words for each Gaussian.
@group(1) @binding(2) var<storage, read> color_records: array<u32>;
@group(1) @binding(3) var<storage, read> codebooks: array<u32>;
// Four codebooks of 36 four-vectors; a uniform, since few storage buffers are left and all threads read the same.
@group(1) @binding(4) var<uniform> codebook_scales: array<vec4<f32>, 144>;
#else
@group(1) @binding(2) var<storage, read> harmonics: array<vec4<f32>>;
#endif
#else
@group(1) @binding(0) var<storage, read> gaussians: array<Gaussian>;
@group(1) @binding(1) var<storage, read> harmonics: array<vec4<f32>>;
#endif

// The list that `activate` writes; not read without a filter.
@group(2) @binding(0) var<storage, read> active_list: array<u32>;

#ifdef BINNED
// Bins that a workgroup counts by itself before it reserves places for all of its splats at once.
const OWN_BINS: u32 = 2048u;

var<workgroup> own: array<atomic<u32>, 2048>;
var<workgroup> own_visible: atomic<u32>;
// Tiles of the splat that project_one made: first and last + 1.
var<private> covered: vec4<u32>;

// Tiles (of 4 x 4) of a bin that `covered` holds.
fn tiles_of_bin(bin: vec2<u32>) -> u32 {
    let first = max(covered.xy, bin * 4u) - bin * 4u;
    let last = min(covered.zw, bin * 4u + 4u) - bin * 4u;
    let columns = (1u << last.x) - (1u << first.x);
    let rows = 0x1111u & ((1u << (4u * last.y)) - (1u << (4u * first.y)));
    return columns * rows;
}

@compute @workgroup_size(256)
fn project_bin(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let across = instance.binning.x;
    let capacity = instance.binning.y;
    let first_bin = instance.binning.z + BIN_COUNTERS;
    let down = (instance.tiles.y + 3u) / 4u;
    let count = across * down;
    let by_group = count <= OWN_BINS;
    for (var i = thread; i < min(count, OWN_BINS); i += 256u) {
        atomicStore(&own[i], 0u);
    }
    if thread == 0u {
        atomicStore(&own_visible, 0u);
    }
    workgroupBarrier();
    covered = vec4(0u);
    let slot = instance.first_slot + id.x;
    if id.x < instance.count {
        var index = id.x;
        if instance.listed != 0u {
            index = active_list[instance.first_listed + id.x];
        }
        if project_one(index, slot) == INVISIBLE {
            // Not found by a search through all splats.
            splats[slot].tiles_high = 0u;
            covered = vec4(0u);
        } else {
            atomicAdd(&own_visible, 1u);
        }
    }
    let low = covered.xy / 4u;
    let high = (covered.zw + 3u) / 4u;
    if by_group {
        for (var y = low.y; y < high.y; y++) {
            for (var x = low.x; x < high.x; x++) {
                atomicAdd(&own[y * across + x], 1u);
            }
        }
    }
    workgroupBarrier();
    if thread == 0u {
        atomicAdd(&bins[instance.binning.z], atomicLoad(&own_visible));
    }
    for (var i = thread; i < min(count, OWN_BINS); i += 256u) {
        let many = atomicLoad(&own[i]);
        if many > 0u {
            atomicStore(&own[i], atomicAdd(&bins[first_bin + i], many));
        }
    }
    workgroupBarrier();
    for (var y = low.y; y < high.y; y++) {
        for (var x = low.x; x < high.x; x++) {
            let bin = y * across + x;
            var place = 0u;
            if by_group {
                place = atomicAdd(&own[bin], 1u);
            } else {
                place = atomicAdd(&bins[first_bin + bin], 1u);
            }
            if place < capacity {
                bin_entries[bin * capacity + place] = vec2(tiles_of_bin(vec2(x, y)), slot);
            }
        }
    }
}
#else
@compute @workgroup_size(256)
fn project(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= instance.count {
        return;
    }
    let slot = instance.first_slot + id.x;
    var index = id.x;
    if instance.listed != 0u {
        index = active_list[instance.first_listed + id.x];
    }
    depth_keys[slot] = project_one(index, slot);
}
#endif

fn load_gaussian(index: u32) -> Gaussian {
#ifdef PACKED_GEOMETRY
    let block = SHARED_RANGES + index / PACKED_BLOCK * BLOCK_RANGES;
    let low = records[2u * index];
    let high = records[2u * index + 1u];
    return unpack_gaussian(low, high, ranges[0], ranges[1], ranges[block], ranges[block + 1u]);
#else
    return gaussians[index];
#endif
}

// Writes the splat of a Gaussian into its slot and returns its depth key.
fn project_one(index: u32, slot: u32) -> u32 {
    let g = load_gaussian(index);
    let dt = instance.time - g.mean_t;
    let z = dt * g.inverse_sigma_t;
    var marginal = exp(-0.5 * z * z);
    let absent = marginal <= MARGINAL_CUTOFF;
    if absent {
        if instance.debug != DEBUG_ACTIVE {
            return INVISIBLE;
        }
        marginal = MARGINAL_CUTOFF;
    }
    let mean = vec4(g.mean + g.velocity * dt, 1.0);
    if instance.cropped != 0u {
        let place = vec3(dot(instance.crop_x, mean), dot(instance.crop_y, mean), dot(instance.crop_z, mean));
        // Written so that NaN is outside.
        if !all(abs(place) <= vec3(1.0)) {
            return INVISIBLE;
        }
    }
    let q = vec3(dot(instance.camera_x, mean), dot(instance.camera_y, mean), dot(instance.camera_z, mean));
    if q.z <= instance.near {
        return INVISIBLE;
    }
    let size = vec2<f32>(instance.size);
    let parallel = instance.orthographic != 0u;
    let ndc = vec2(dot(instance.clip_x, mean), dot(instance.clip_y, mean)) / select(q.z + 1e-7, 1.0, parallel);
    let center = ((ndc + 1.0) * size - 1.0) * 0.5;

    // The nesting of min and max matters: with the field-of-view sentinel the limits are negative.
    let limit = FRUSTUM_CLAMP * instance.reach;
    let ray = select(min(limit, max(-limit, q.xy / q.z)), vec2(0.0), parallel);
    let j = instance.focal / select(q.z, 1.0, parallel);
    let mx = j.x * (instance.camera_x.xyz - ray.x * instance.camera_z.xyz);
    let my = j.y * (instance.camera_y.xyz - ray.y * instance.camera_z.xyz);
    let ca = g.covariance_a;
    let cb = g.covariance_b;
    let covariance = mat3x3(ca.x, ca.y, ca.z, ca.y, ca.w, cb.x, ca.z, cb.x, cb.y);
    let cx = covariance * mx;
    let a = dot(mx, cx) + LOW_PASS;
    let b = dot(my, cx);
    let c = dot(my, covariance * my) + LOW_PASS;
    let det = a * c - b * b;
    if det == 0.0 {
        return INVISIBLE;
    }
    let mid = 0.5 * (a + c);
    let radius = ceil(3.0 * sqrt(mid + sqrt(max(0.1, mid * mid - det))));
    // Neither infinite nor NaN.
    if !(radius <= 3.4e38) {
        return INVISIBLE;
    }
    let opacity = g.opacity * marginal * instance.opacity;
    let square = tiles_of(center, radius, vec2<f32>(instance.tiles));
    let tiles = contributing_tiles(square, center, vec2(a, c), det, opacity);
    // Written so that NaN is invisible.
    if !(tiles.z > tiles.x && tiles.w > tiles.y) {
        return INVISIBLE;
    }

#ifdef BINNED
    covered = vec4<u32>(tiles);
#endif
    var seen = g.mean;
    if instance.displaced != 0u {
        seen = mean.xyz;
    }
    var splat: SplatRecord;
    splat.center = center;
    splat.opacity = opacity;
    splat.depth = q.z;
    splat.conic = vec3(c, -b, a) / det;
    if instance.debug >= DEBUG_ACTIVE {
        splat.color = debug_color(g, absent);
    } else {
        var direction = instance.camera_position;
        if !parallel {
            direction = normalize(seen - instance.camera_position);
        }
        splat.color = lit(color(index, direction, -dt), instance.lighting, instance.light);
    }
    let words = pack_tiles(tiles);
    splat.tiles_low = words.x;
    splat.tiles_high = words.y;
    splats[slot] = splat;
    // Positive floats have the same order as their bits. Depths are taken from the near plane of an orthographic
    // camera, which may be behind it.
    return bitcast<u32>(select(q.z, q.z - instance.near, parallel));
}

fn debug_color(g: Gaussian, absent: bool) -> vec3<f32> {
    if instance.debug == DEBUG_VELOCITY {
        // Distance over the whole time interval; one unit is halfway to full color.
        let distance = g.velocity * instance.time_span;
        return 0.5 + 0.5 * distance / (1.0 + length(distance));
    }
    if instance.debug == DEBUG_LIFESPAN {
        // A tenth of the time interval is in the middle.
        return heat(0.25 + 0.75 / (1.0 + 0.1 * instance.time_span * g.inverse_sigma_t));
    }
    return select(vec3(0.1, 0.8, 0.2), vec3(0.9, 0.1, 0.1), absent);
}

#ifdef CODED_COLORS
// First word of this Gaussian's entry in each codebook.
var<private> entries: vec4<u32>;
#else
// First four-vector of this Gaussian's coefficients.
var<private> first_coefficient: u32;
#endif

// Returns four values of this Gaussian's coefficients, RGB innermost.
fn coefficients(at: u32) -> vec4<f32> {
#ifdef CODED_COLORS
    var sum = vec4(0.0);
    for (var stage = 0u; stage < instance.stages; stage++) {
        sum += unpack4x8snorm(codebooks[entries[stage] + at]) * codebook_scales[stage * instance.stride + at];
    }
    return sum;
#else
    return harmonics[first_coefficient + at];
#endif
}

fn color(index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
#ifdef CODED_COLORS
    // The first coefficient is not in the codebooks.
    let start = unpack_base(color_records[3u * index], ranges[2]) * 0.28209479 + 0.5;
    let a = color_records[3u * index + 1u];
    let b = color_records[3u * index + 2u];
    entries = (instance.first_entries + vec4(a & 0xffffu, a >> 16u, b & 0xffffu, b >> 16u)) * instance.stride;
    if instance.stages == 0u {
        return max(start, vec3(0.0));
    }
#else
    let start = vec3(0.5);
    first_coefficient = index * instance.stride;
#endif
    if instance.degree == 0u {
        return max(start + coefficients(0u).xyz * 0.28209479, vec3(0.0));
    }
    let b0 = basis_first(direction);
    if instance.degree == 1u {
        return max(start + four(0u, b0), vec3(0.0));
    }
    let b1 = basis_second(direction);
    let b2 = basis_third(direction);
    if instance.degree == 2u {
        return max(start + four(0u, b0) + four(3u, b1) + coefficients(6u).xyz * b2.x, vec3(0.0));
    }
    let b3 = basis_fourth(direction);
    var sum = start + four(0u, b0) + four(3u, b1) + four(6u, b2) + four(9u, b3);
    for (var n = 1u; n <= instance.degree_t; n++) {
        let block = 12u * n;
        let value = four(block, b0) + four(block + 3u, b1) + four(block + 6u, b2) + four(block + 9u, b3);
        sum += time_cosine(f32(n), tau, instance.time_span) * value;
    }
    return max(sum, vec3(0.0));
}

// Returns the sum of four coefficients (three four-vectors from `at`) times their basis values.
fn four(at: u32, basis: vec4<f32>) -> vec3<f32> {
    let u = coefficients(at);
    let v = coefficients(at + 1u);
    let w = coefficients(at + 2u);
    return u.xyz * basis.x + vec3(u.w, v.xy) * basis.y + vec3(v.zw, w.x) * basis.z + w.yzw * basis.w;
}
