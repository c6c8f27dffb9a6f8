// The color of a Gaussian from its spherical and temporal harmonics, whole or by codebook (CODED_COLORS). In: the Gaussian and its
// index, the time since its mean. Out: its color in the blend space.
#define_import_path gs4d::color

#import gs4d::records::Gaussian
#import gs4d::appearance::{BRIGHTEST, lit}
#import gs4d::capture::{instance, viewing_direction}
#import gs4d::harmonics::{basis_first, basis_second, basis_third, basis_fourth, time_cosine}
#ifdef CODED_COLORS
#import gs4d::capture::ranges
#import gs4d::packed::unpack_base
#endif

#ifdef CODED_COLORS
// Three words for each Gaussian.
@group(3) @binding(0) var<storage, read> color_records: array<u32>;
// Entries of a multiple of six four-vectors: 48 values of half precision for each time harmonic, in the order of `coded_share`.
@group(3) @binding(1) var<storage, read> codebooks: array<vec4<u32>>;
#else
@group(3) @binding(0) var<storage, read> harmonics: array<vec4<f32>>;
#endif

// A color is the sum of this many shares, which several threads can compute.
const SHARES: u32 = 4u;

// Returns the color from the sum of all shares, in the blend space.
fn finished_color(sum: vec3<f32>) -> vec3<f32> {
    return lit(clamp(sum, vec3(0.0), vec3(BRIGHTEST)), instance.lighting, instance.light);
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

// Returns the basis values of the four coefficients of a share.
fn basis_of(share: u32, direction: vec3<f32>) -> vec4<f32> {
    let low = select(basis_first(direction), basis_second(direction), share == 1u);
    let high = select(basis_third(direction), basis_fourth(direction), share == 3u);
    return select(low, high, share >= 2u);
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
// Returns a share of a color: that of four of the sixteen coefficients of each time harmonic, from all codebooks, the first with the first
// coefficient, which is not in the codebooks.
fn color_share(share: u32, index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
    var sum = vec3(0.0);
    if share == 0u {
        sum = unpack_base(color_records[3u * index], ranges[2]) * 0.28209479 + 0.5;
    }
    let basis = basis_of(share, direction);
    let times = time_factors(tau);
    for (var stage = 0u; stage < instance.stages; stage++) {
        let codes = color_records[3u * index + 1u + stage / 2u];
        let code = (codes >> (16u * (stage & 1u))) & 0xffffu;
        let entry = (instance.first_entries[stage] + code) * (instance.stride / 4u);
        sum += coded_share(entry, share, basis, times);
    }
    return sum;
}
#else
// Returns a share of a color: that of four of the sixteen coefficients of each time harmonic.
fn color_share(share: u32, index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
    let basis = basis_of(share, direction);
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
// Returns the share of an entry of a codebook: the sum of four coefficients of each time harmonic times their factors. The values of the four
// shares take turns of four words, then of two: threads of one splat read neighboring words.
fn coded_share(entry: u32, share: u32, basis: vec4<f32>, times: vec3<f32>) -> vec3<f32> {
    let a = codebooks[entry + share];
    if instance.degree_t == 0u {
        return coded(a.xyz, vec3(a.w, last_pair(entry + 4u, share)), basis);
    }
    let b = codebooks[entry + 4u + share];
    let c = codebooks[entry + 8u + share];
    let sum = coded(a.xyz, vec3(a.w, b.xy), basis) + times.y * coded(vec3(b.zw, c.x), c.yzw, basis);
    if instance.degree_t == 1u {
        return sum;
    }
    let d = codebooks[entry + 12u + share];
    return sum + times.z * coded(d.xyz, vec3(d.w, last_pair(entry + 16u, share)), basis);
}

// Returns two words of a share, of which there are those of all shares from `at` on.
fn last_pair(at: u32, share: u32) -> vec2<u32> {
    let both = codebooks[at + share / 2u];
    return select(both.xy, both.zw, (share & 1u) == 1u);
}

// Returns the sum of four coefficients (six words of two values, RGB innermost) times their basis values.
fn coded(low: vec3<u32>, high: vec3<u32>, basis: vec4<f32>) -> vec3<f32> {
    let a = unpack2x16float(low.x);
    let b = unpack2x16float(low.y);
    let c = unpack2x16float(low.z);
    let d = unpack2x16float(high.x);
    let e = unpack2x16float(high.y);
    let f = unpack2x16float(high.z);
    return four(vec4(a, b), vec4(c, d), vec4(e, f), basis);
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
