// Gaussians and splats, and their records in storage. Drivers load and store each member of a structure separately:
// records have members of four words, the widest access.
#define_import_path gs4d::records

#import gs4d::types::{GaussianRecord, SplatRecord, SplatShape}

// One Gaussian in the runtime form. `inverse_sigma_t` is 0 for a Gaussian that is present at every time.
struct Gaussian {
    mean: vec3<f32>,
    mean_t: f32,
    velocity: vec3<f32>,
    inverse_sigma_t: f32,
    // Conditional covariance: xx, xy, xz, yy.
    covariance_a: vec4<f32>,
    // yz, zz.
    covariance_b: vec2<f32>,
    opacity: f32,
}

fn read_gaussian(record: GaussianRecord) -> Gaussian {
    return Gaussian(
        record.mean.xyz,
        record.mean.w,
        record.velocity.xyz,
        record.velocity.w,
        record.covariance_a,
        record.covariance_b.xy,
        record.covariance_b.z,
    );
}

fn covariance_of(g: Gaussian) -> mat3x3<f32> {
    let a = g.covariance_a;
    let b = g.covariance_b;
    return mat3x3(a.x, a.y, a.z, a.y, a.w, b.x, a.z, b.x, b.y);
}

// A Gaussian on the screen.
struct Splat {
    center: vec2<f32>,
    opacity: f32,
    depth: f32,
    // Factored; see conic.wgsl.
    conic: vec3<f32>,
    color: vec3<f32>,
}

fn read_splat(record: SplatRecord) -> Splat {
    return splat_of(record.place, bitcast<vec3<f32>>(record.shape.xyz), bitcast<vec3<f32>>(record.color.xyz));
}

// Returns a splat of tile bins, which stores colors in a separate buffer.
fn read_shape(shape: SplatShape, color: vec3<f32>) -> Splat {
    return splat_of(shape.place, shape.conic.xyz, color);
}

fn splat_of(place: vec4<f32>, conic: vec3<f32>, color: vec3<f32>) -> Splat {
    return Splat(place.xy, place.z, place.w, conic, color);
}

// Returns the record of a splat. `tiles` are x0, y0 and x1, y1 (ends excluded), 16 bits each.
fn record_of(splat: Splat, tiles: vec2<u32>) -> SplatRecord {
    return SplatRecord(
        vec4(splat.center, splat.opacity, splat.depth),
        vec4(bitcast<vec3<u32>>(splat.conic), tiles.x),
        vec4(bitcast<vec3<u32>>(splat.color), tiles.y),
    );
}
