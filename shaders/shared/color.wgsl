// The color of a Gaussian from its spherical and temporal harmonics, whole or by codebook (CODED_COLORS). In: the Gaussian and its
// index, the time since its mean. Out: its color in the blend space.
#define_import_path gs4d::color

#import gs4d::types::Gaussian
#import gs4d::appearance::lit
#import gs4d::capture::instance
#import gs4d::harmonics::{basis_first, basis_second, basis_third, basis_fourth, time_cosine}
#ifdef CODED_COLORS
#import gs4d::capture::ranges
#import gs4d::packed::unpack_base
#endif

#ifdef CODED_COLORS
// Three words for each Gaussian.
@group(3) @binding(0) var<storage, read> color_records: array<u32>;
// Entries of a multiple of three four-vectors: 48 signed bytes for each time harmonic.
@group(3) @binding(1) var<storage, read> codebooks: array<vec4<u32>>;
// The value of a byte of 1: four codebooks of 36 four-vectors; a uniform, since few storage buffers are left and all threads read the same.
@group(3) @binding(2) var<uniform> codebook_scales: array<vec4<f32>, 144>;
#else
@group(3) @binding(0) var<storage, read> harmonics: array<vec4<f32>>;
#endif

// A color is the sum of this many shares, which several threads can compute.
const SHARES: u32 = 4u;

// Returns the direction from which a Gaussian is seen in the view of the instance.
fn viewing_direction(g: Gaussian, dt: f32) -> vec3<f32> {
    if instance.orthographic != 0u {
        return instance.camera_position;
    }
    var seen = g.mean;
    if instance.displaced != 0u {
        seen += g.velocity * dt;
    }
    return normalize(seen - instance.camera_position);
}

// Returns the color from the sum of all shares, in the blend space.
fn finished_color(sum: vec3<f32>) -> vec3<f32> {
    return lit(max(sum, vec3(0.0)), instance.lighting, instance.light);
}

// Returns the color of a Gaussian in the view of the instance, in the blend space.
fn seen_color(index: u32, g: Gaussian, dt: f32) -> vec3<f32> {
    let direction = viewing_direction(g, dt);
    var sum = vec3(0.0);
    for (var share = 0u; share < SHARES; share++) {
        sum += color_share(share, index, direction, -dt);
    }
    return finished_color(sum);
}

// Returns the factors of the time harmonics.
fn time_factors(tau: f32) -> vec3<f32> {
    var times = vec3(1.0, 0.0, 0.0);
    if instance.degree_t >= 1u {
        times.y = time_cosine(1.0, tau, instance.time_span);
    }
    if instance.degree_t >= 2u {
        times.z = time_cosine(2.0, tau, instance.time_span);
    }
    return times;
}

#ifdef CODED_COLORS
// Returns a share of a color: that of one codebook, the first with the first coefficient, which is not in the codebooks.
fn color_share(share: u32, index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
    var sum = vec3(0.0);
    if share == 0u {
        sum = unpack_base(color_records[3u * index], ranges[2]) * 0.28209479 + 0.5;
    }
    if share >= instance.stages {
        return sum;
    }
    let b0 = basis_first(direction);
    let b1 = basis_second(direction);
    let b2 = basis_third(direction);
    let b3 = basis_fourth(direction);
    let times = time_factors(tau);
    let codes = color_records[3u * index + 1u + share / 2u];
    let code = (codes >> (16u * (share & 1u))) & 0xffffu;
    let entry = (instance.first_entries[share] + code) * (instance.stride / 4u);
    // Without some time harmonics their factors are 0, and other entries are read in their place.
    let second = min(1u, instance.degree_t) * 3u;
    let third = min(2u, instance.degree_t) * 3u;
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
    let scale = share * instance.stride;
    sum += coded_block(u0, v0, w0, scale, b0, b1, b2, b3);
    sum += times.y * coded_block(u1, v1, w1, scale + 4u * second, b0, b1, b2, b3);
    sum += times.z * coded_block(u2, v2, w2, scale + 4u * third, b0, b1, b2, b3);
    return sum;
}
#else
// Returns a share of a color: that of four of the sixteen coefficients of each time harmonic.
fn color_share(share: u32, index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
    let b0 = basis_first(direction);
    let b1 = basis_second(direction);
    let b2 = basis_third(direction);
    let b3 = basis_fourth(direction);
    let basis = select(select(b0, b1, share == 1u), select(b2, b3, share == 3u), share >= 2u);
    var sum = vec3(select(0.0, 0.5, share == 0u));
    if instance.degree == 3u {
        let times = time_factors(tau);
        for (var n = 0u; n <= instance.degree_t; n++) {
            sum += times[n] * whole(index, 12u * n + 3u * share, basis);
        }
        return sum;
    }
    // There are (degree + 1)^2 coefficients: one, four or nine.
    let left = (instance.degree + 1u) * (instance.degree + 1u) - min(4u * share, (instance.degree + 1u) * (instance.degree + 1u));
    if left >= 4u {
        sum += whole(index, 3u * share, basis);
    } else if left == 1u {
        sum += harmonic(index, 3u * share).xyz * basis.x;
    }
    return sum;
}
#endif

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
