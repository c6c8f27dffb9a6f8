// The trained form: raw parameters as the optimizer stores them. CPU reference: src/gaussian/slice.rs. Axes are x, y,
// z, t; quaternions are (w, x, y, z), rotations use the flipped convention.
#define_import_path gs4d::trained

#import gs4d::training::TrainedRecord

const STATIC_3D: u32 = 0u;
const UNROTATED_4D: u32 = 1u;
const ROTATED_4D: u32 = 2u;

// `left_matrix` and `right_matrix` return the factors L and R of the 4D rotation Q = L R of the unit quaternions l and
// r.
fn left_matrix(l: vec4<f32>) -> mat4x4<f32> {
    return mat4x4(
        vec4(l.x, -l.y, l.z, -l.w),
        vec4(l.y, l.x, -l.w, -l.z),
        vec4(-l.z, l.w, l.x, -l.y),
        vec4(l.w, l.z, l.y, l.x),
    );
}

fn right_matrix(r: vec4<f32>) -> mat4x4<f32> {
    return mat4x4(
        vec4(r.x, -r.y, r.z, r.w),
        vec4(r.y, r.x, -r.w, r.z),
        vec4(-r.z, r.w, r.x, r.y),
        vec4(-r.w, -r.z, -r.y, r.x),
    );
}

// Returns the 3D rotation matrix of a unit quaternion.
fn rotation_3d(q: vec4<f32>) -> mat3x3<f32> {
    let w = q.x;
    let v = q.yzw;
    return mat3x3(
        vec3(1.0 - 2.0 * (v.y * v.y + v.z * v.z), 2.0 * (v.x * v.y + w * v.z), 2.0 * (v.x * v.z - w * v.y)),
        vec3(2.0 * (v.x * v.y - w * v.z), 1.0 - 2.0 * (v.x * v.x + v.z * v.z), 2.0 * (v.y * v.z + w * v.x)),
        vec3(2.0 * (v.x * v.z + w * v.y), 2.0 * (v.y * v.z - w * v.x), 1.0 - 2.0 * (v.x * v.x + v.y * v.y)),
    );
}

// A sliced Gaussian: conditional covariance, covariance of position with time c, temporal variance v (without the
// prefilter).
struct Sliced {
    covariance: mat3x3<f32>,
    c: vec3<f32>,
    v: f32,
}

// Returns the slice of a Gaussian. The columns of M = Q S are the columns of the rotation times the scales; the
// covariance is M transpose(M).
fn slice_of(trained: TrainedRecord, model: u32) -> Sliced {
    let scale = exp(trained.log_scale.xyz);
    let l = normalize(trained.rotation_l);
    if model != ROTATED_4D {
        let m = rotation_3d(l) * diagonal(scale);
        return Sliced(m * transpose(m), vec3(0.0), exp(trained.log_scale.w));
    }
    let s = vec4(scale, exp(trained.log_scale.w));
    let q = left_matrix(l) * right_matrix(normalize(trained.rotation_r));
    let m = mat4x4(q[0] * s.x, q[1] * s.y, q[2] * s.z, q[3] * s.w);
    let sigma = m * transpose(m);
    let c = sigma[3].xyz;
    let v = sigma[3].w;
    let a = mat3x3(sigma[0].xyz, sigma[1].xyz, sigma[2].xyz);
    return Sliced(a - outer(c, c / v), c, v);
}

fn diagonal(d: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(vec3(d.x, 0.0, 0.0), vec3(0.0, d.y, 0.0), vec3(0.0, 0.0, d.z));
}

// Returns a transpose(b).
fn outer(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(a * b.x, a * b.y, a * b.z);
}

fn opacity_of(logit: f32) -> f32 {
    return 1.0 / (1.0 + exp(-logit));
}
