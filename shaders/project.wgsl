// project: slices each Gaussian at the view's time and projects it, as the original rasterizer does.
// In: Gaussians, color coefficients, an instance, a list of active Gaussians. Out: one splat and one depth key for each
// active Gaussian; the key of an invisible splat is INVISIBLE. CPU reference: src/reference/project.rs with
// src/gaussian/projection.rs.
#import gs4d::types::{Gaussian, InstanceUniforms, SplatRecord, INVISIBLE}
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
@group(0) @binding(2) var<storage, read_write> depth_keys: array<u32>;
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
