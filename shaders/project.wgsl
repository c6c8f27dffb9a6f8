// project: slices each Gaussian at the view's time and projects it, as the original rasterizer does.
// In: Gaussians, color coefficients, an instance, a list of active Gaussians. Out: one splat and one depth key for each
// active Gaussian; the key of an invisible splat is INVISIBLE. CPU reference: src/reference/project.rs with
// src/gaussian/projection.rs.
#import gs4d::types::{Gaussian, InstanceUniforms, SplatRecord, BIN_COUNTERS, INVISIBLE}
#import gs4d::types::{DEBUG_ACTIVE, DEBUG_LIFESPAN, DEBUG_VELOCITY}
#import gs4d::appearance::{heat, lit}
#import gs4d::tile::{contributing_tiles, pack_tiles, tiles_of}
#ifdef BINNED
#import gs4d::bins::{depth_order, entry_word, stamp}
#endif
#ifdef PACKED_GEOMETRY
#import gs4d::packed::{unpack_base, unpack_gaussian, unpack_lifespan, BLOCK_RANGES, PACKED_BLOCK, SHARED_RANGES}
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
// Bin by bin: the depth key of a splat, and its slot with the tiles of the bin that it covers.
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
// Entries of a multiple of three four-vectors: 48 signed bytes for each time harmonic.
@group(1) @binding(3) var<storage, read> codebooks: array<vec4<u32>>;
// The value of a byte of 1: four codebooks of 36 four-vectors; a uniform, since few storage buffers are left and all threads read the same.
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
// Bins into which a thread puts its splat by itself.
const OWN_ENTRIES: u32 = 16u;
const WIDE: u32 = 64u;

var<workgroup> own: array<atomic<u32>, 2048>;
var<workgroup> own_visible: atomic<u32>;
var<workgroup> own_pairs: atomic<u32>;
// Splats of more bins than OWN_ENTRIES, which all threads put into bins together: as far as there is room for them, tiles, depth key
// and slot.
var<workgroup> wide: array<vec4<u32>, WIDE>;
var<workgroup> wide_count: atomic<u32>;
// What the colors of the visible splats need, without gaps: index and slot; the point that is seen, and tau.
var<workgroup> seen_splats: array<vec2<u32>, 256>;
var<workgroup> seen_points: array<vec4<f32>, 256>;
// Those of the splat that project_one made.
var<private> seen_point: vec4<f32>;
// Tiles of the splat that project_one made, first and last + 1, and its depth.
var<private> covered: vec4<u32>;
var<private> covered_depth: f32;

// Returns the number of tiles along each side of a bin.
fn side() -> u32 {
    return instance.binning.x & 0xffu;
}

// Returns the number of bins across and down the picture.
fn bin_grid() -> vec2<u32> {
    return (instance.tiles + side() - 1u) / side();
}

// Returns the first bin and the last + 1 of a rectangle of tiles.
fn bins_of(tiles: vec4<u32>) -> vec4<u32> {
    return vec4(tiles.xy, tiles.zw + side() - 1u) / side();
}

// Puts a splat into one of its bins: into its place among those of the workgroup if they have been counted, else of all.
fn put_in_bin(x: u32, y: u32, tiles: vec4<u32>, key: u32, slot: u32, by_group: bool) {
    let bin = y * bin_grid().x + x;
    let capacity = instance.binning.y;
    var place = 0u;
    if by_group {
        place = atomicAdd(&own[bin], 1u);
    } else {
        place = atomicAdd(&bins[instance.binning.z + BIN_COUNTERS + bin], 1u);
    }
    if place < capacity {
        let corner = side() * vec2(x, y);
        let first = max(tiles.xy, corner) - corner;
        let last = min(tiles.zw, corner + side()) - 1u - corner;
        bin_entries[bin * capacity + place] = vec2(key, entry_word(slot, first, last));
    }
}

@compute @workgroup_size(256)
fn project_bin(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let first_bin = instance.binning.z + BIN_COUNTERS;
    let grid = bin_grid();
    let across = grid.x;
    let count = grid.x * grid.y;
    let by_group = count <= OWN_BINS;
    for (var i = thread; i < min(count, OWN_BINS); i += 256u) {
        atomicStore(&own[i], 0u);
    }
    if thread == 0u {
        atomicStore(&own_visible, 0u);
        atomicStore(&own_pairs, 0u);
        atomicStore(&wide_count, 0u);
    }
    workgroupBarrier();
    covered = vec4(0u);
    var key = 0u;
    let slot = instance.first_slot + id.x;
    if id.x < instance.count {
        var index = id.x;
        if instance.listed != 0u {
            index = active_list[instance.first_listed + id.x];
        }
        if project_one(index, slot) == INVISIBLE {
            covered = vec4(0u);
        } else {
            let place = atomicAdd(&own_visible, 1u);
            seen_splats[place] = vec2(index, slot);
            seen_points[place] = seen_point;
            atomicAdd(&own_pairs, (covered.z - covered.x) * (covered.w - covered.y));
            key = depth_order(covered_depth);
        }
    }
    var own_bins = bins_of(covered);
    if (own_bins.z - own_bins.x) * (own_bins.w - own_bins.y) > OWN_ENTRIES {
        let place = atomicAdd(&wide_count, 1u);
        if place < WIDE {
            wide[place] = vec4(covered.xy | (covered.zw << vec2(16u)), key, slot);
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
        atomicAdd(&bins[instance.binning.z], atomicLoad(&own_visible));
        atomicAdd(&bins[instance.binning.z + 1u], atomicLoad(&own_pairs));
    }
    for (var i = thread; i < min(count, OWN_BINS); i += 256u) {
        let many = atomicLoad(&own[i]);
        if many > 0u {
            atomicStore(&own[i], atomicAdd(&bins[first_bin + i], many));
        }
    }
    // The colors are a task of the first threads, so that none waits for those without a splat.
    if thread < atomicLoad(&own_visible) && instance.debug < DEBUG_ACTIVE {
        let own_splat = seen_splats[thread];
        let point = seen_points[thread];
        splats[own_splat.y].color = seen_color(own_splat.x, point.xyz, point.w);
    }
    workgroupBarrier();
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

// Returns mean_t and inverse_sigma_t.
fn load_lifespan(index: u32) -> vec2<f32> {
#ifdef PACKED_GEOMETRY
    return unpack_lifespan(records[2u * index], ranges[0]);
#else
    return vec2(gaussians[index].mean_t, gaussians[index].inverse_sigma_t);
#endif
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
    // Half of the record is enough to drop an absent Gaussian.
    let lifespan = load_lifespan(index);
    let dt = instance.time - lifespan.x;
    let z = dt * lifespan.y;
    var marginal = exp(-0.5 * z * z);
    let absent = marginal <= MARGINAL_CUTOFF;
    if absent {
        if instance.debug != DEBUG_ACTIVE {
            return INVISIBLE;
        }
        marginal = MARGINAL_CUTOFF;
    }
    let g = load_gaussian(index);
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
    covered_depth = q.z;
#endif
    var seen = g.mean;
    if instance.displaced != 0u {
        seen = mean.xyz;
    }
    splats[slot].center = center;
    splats[slot].opacity = opacity;
    splats[slot].depth = q.z;
    splats[slot].conic = vec3(c, -b, a) / det;
    if instance.debug >= DEBUG_ACTIVE {
        splats[slot].color = debug_color(g, absent);
    } else {
#ifdef BINNED
        seen_point = vec4(seen, -dt);
#else
        splats[slot].color = seen_color(index, seen, -dt);
#endif
    }
    var words = pack_tiles(tiles);
#ifdef BINNED
    words |= stamp(instance.binning.x >> 8u);
#endif
    splats[slot].tiles_low = words.x;
    splats[slot].tiles_high = words.y;
    // Positive floats have the same order as their bits. Depths are taken from the near plane of an orthographic
    // camera, which may be behind it.
    return bitcast<u32>(select(q.z, q.z - instance.near, parallel));
}

// Returns the color of a Gaussian seen at a point, in the blend space.
fn seen_color(index: u32, seen: vec3<f32>, tau: f32) -> vec3<f32> {
    var direction = instance.camera_position;
    if instance.orthographic == 0u {
        direction = normalize(seen - instance.camera_position);
    }
    return lit(color(index, direction, tau), instance.lighting, instance.light);
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

fn color(index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
    let b0 = basis_first(direction);
    let b1 = basis_second(direction);
    let b2 = basis_third(direction);
    let b3 = basis_fourth(direction);
    // Factors of the time harmonics.
    var times = vec3(1.0, 0.0, 0.0);
    if instance.degree_t >= 1u {
        times.y = time_cosine(1.0, tau, instance.time_span);
    }
    if instance.degree_t >= 2u {
        times.z = time_cosine(2.0, tau, instance.time_span);
    }
#ifdef CODED_COLORS
    // The first coefficient is not in the codebooks.
    var sum = unpack_base(color_records[3u * index], ranges[2]) * 0.28209479 + 0.5;
    let a = color_records[3u * index + 1u];
    let b = color_records[3u * index + 2u];
    let entries = (instance.first_entries + vec4(a & 0xffffu, a >> 16u, b & 0xffffu, b >> 16u)) * (instance.stride / 4u);
    // Without some time harmonics their factors are 0, and other entries are read in their place.
    let second = min(1u, instance.degree_t) * 3u;
    let third = min(2u, instance.degree_t) * 3u;
    for (var stage = 0u; stage < instance.stages; stage++) {
        let entry = entries[stage];
        // All at once, to hide their latency.
        let u0 = codebooks[entry];
        let v0 = codebooks[entry + 1u];
        let w0 = codebooks[entry + 2u];
        let u1 = codebooks[entry + second];
        let v1 = codebooks[entry + second + 1u];
        let w1 = codebooks[entry + second + 2u];
        let u2 = codebooks[entry + third];
        let v2 = codebooks[entry + third + 1u];
        let w2 = codebooks[entry + third + 2u];
        let scale = stage * instance.stride;
        sum += coded_block(u0, v0, w0, scale, b0, b1, b2, b3);
        sum += times.y * coded_block(u1, v1, w1, scale + 4u * second, b0, b1, b2, b3);
        sum += times.z * coded_block(u2, v2, w2, scale + 4u * third, b0, b1, b2, b3);
    }
    return max(sum, vec3(0.0));
#else
    let start = vec3(0.5);
    if instance.degree == 0u {
        return max(start + harmonic(index, 0u).xyz * b0.x, vec3(0.0));
    }
    if instance.degree == 1u {
        return max(start + whole(index, 0u, b0), vec3(0.0));
    }
    if instance.degree == 2u {
        let last = harmonic(index, 6u).xyz * b2.x;
        return max(start + whole(index, 0u, b0) + whole(index, 3u, b1) + last, vec3(0.0));
    }
    var sum = start;
    for (var n = 0u; n <= instance.degree_t; n++) {
        let at = 12u * n;
        let value = whole(index, at, b0) + whole(index, at + 3u, b1) + whole(index, at + 6u, b2) + whole(index, at + 9u, b3);
        sum += times[n] * value;
    }
    return max(sum, vec3(0.0));
#endif
}

#ifdef CODED_COLORS
// Returns the sum of the sixteen coefficients of one time harmonic times their basis values.
fn coded_block(
    u: vec4<u32>,
    v: vec4<u32>,
    w: vec4<u32>,
    scale: u32,
    b0: vec4<f32>,
    b1: vec4<f32>,
    b2: vec4<f32>,
    b3: vec4<f32>,
) -> vec3<f32> {
    return coded(u.xyz, scale, b0) + coded(vec3(u.w, v.xy), scale + 3u, b1)
        + coded(vec3(v.zw, w.x), scale + 6u, b2) + coded(w.yzw, scale + 9u, b3);
}

// Returns the sum of four coefficients (three words of signed bytes) times their basis values; `scale` is the first of their
// values of a byte of 1.
fn coded(words: vec3<u32>, scale: u32, basis: vec4<f32>) -> vec3<f32> {
    let u = signed_bytes(words.x) * codebook_scales[scale];
    let v = signed_bytes(words.y) * codebook_scales[scale + 1u];
    let w = signed_bytes(words.z) * codebook_scales[scale + 2u];
    return four(u, v, w, basis);
}

fn signed_bytes(word: u32) -> vec4<f32> {
    return vec4<f32>(unpack4xI8(word));
}
#else
// Returns the sum of four coefficients (three four-vectors from `at`) of a Gaussian times their basis values.
fn whole(index: u32, at: u32, basis: vec4<f32>) -> vec3<f32> {
    return four(harmonic(index, at), harmonic(index, at + 1u), harmonic(index, at + 2u), basis);
}

fn harmonic(index: u32, at: u32) -> vec4<f32> {
    return harmonics[index * instance.stride + at];
}
#endif

// Returns the sum of four coefficients, RGB innermost, times their basis values.
fn four(u: vec4<f32>, v: vec4<f32>, w: vec4<f32>, basis: vec4<f32>) -> vec3<f32> {
    return u.xyz * basis.x + vec3(u.w, v.xy) * basis.y + vec3(v.zw, w.x) * basis.z + w.yzw * basis.w;
}
