// The color of a Gaussian from its spherical and temporal harmonics, stored whole or by codebook (CODED_COLORS). In:
// the Gaussian, its index and the time since its temporal mean. Out: its color in the blend space.
//
// A color is a sum of SHARES partial sums. Each partial sum, called share here and in src/renderer/capture/buffers.rs,
// has four of the sixteen coefficients of each time harmonic.
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
// Entries of a multiple of six four-vectors: 48 half-precision values for each time harmonic, in the order of
// `coded_share`.
@group(3) @binding(1) var<storage, read> codebooks: array<vec4<u32>>;
#else
@group(3) @binding(0) var<storage, read> harmonics: array<vec4<f32>>;
#endif

// Number of partial sums of a color. In `colors`, each thread computes one.
const SHARES: u32 = 4u;

// Returns the color in the blend space from the sum of all shares.
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
// Returns a share of a color, summed over all codebooks. The first share includes the DC coefficient, which is not in
// the codebooks.
fn color_share(share: u32, index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
    var sum = vec3(0.0);
    if share == 0u {
        sum = unpack_base(color_records[3u * index], ranges[2]) * 0.28209479 + 0.5;
    }
    if instance.stages == 0u {
        return sum;
    }
    let basis = basis_of(share, direction);
    let times = time_factors(tau);
    let words = vec2(color_records[3u * index + 1u], color_records[3u * index + 2u]);
    let codes = vec4(words.x & 0xffffu, words.x >> 16u, words.y & 0xffffu, words.y >> 16u);
    // Unused codebooks read the first entry, with factor 0.
    let used = vec4(0u, 1u, 2u, 3u) < vec4(instance.stages);
    let entries = select(vec4(0u), (instance.first_entries + codes) * (instance.stride / 4u), used);
    // All entries are loaded before any entry is decoded: a thread waits for memory once.
    let a = load_entry(entries.x, share);
    let b = load_entry(entries.y, share);
    let c = load_entry(entries.z, share);
    let d = load_entry(entries.w, share);
    let factors = select(vec4(0.0), vec4(1.0), used);
    sum += factors.x * coded_share(a, share, basis, times) + factors.y * coded_share(b, share, basis, times);
    return sum + factors.z * coded_share(c, share, basis, times) + factors.w * coded_share(d, share, basis, times);
}
#else
// Returns a share of a color.
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
// The share of a codebook entry: words of two values. If an entry has fewer time harmonics, other words of the entry
// fill the missing ones; their factors are 0.
struct EntryShare {
    a: vec4<u32>,
    b: vec4<u32>,
    c: vec4<u32>,
    d: vec4<u32>,
    e: vec4<u32>,
}

// Returns the share of an entry. The words of the four shares are interleaved in groups of four, then of two, so that
// the threads of one splat read neighboring words.
fn load_entry(entry: u32, share: u32) -> EntryShare {
    let own = entry + share;
    let pair = entry + share / 2u;
    let timed = instance.degree_t >= 1u;
    let twice = instance.degree_t >= 2u;
    return EntryShare(
        codebooks[own],
        codebooks[select(pair, own, timed) + 4u],
        codebooks[select(own, own + 8u, timed)],
        codebooks[select(own, own + 12u, twice)],
        codebooks[select(own, pair + 16u, twice)],
    );
}

// Returns the sum of four coefficients of each time harmonic times their factors.
fn coded_share(entry: EntryShare, share: u32, basis: vec4<f32>, times: vec3<f32>) -> vec3<f32> {
    let second = (share & 1u) == 1u;
    let pair = select(entry.b.xy, entry.b.zw, second && instance.degree_t == 0u);
    return coded(entry.a.xyz, vec3(entry.a.w, pair), basis)
        + times.y * coded(vec3(entry.b.zw, entry.c.x), entry.c.yzw, basis)
        + times.z * coded(entry.d.xyz, vec3(entry.d.w, select(entry.e.xy, entry.e.zw, second)), basis);
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
