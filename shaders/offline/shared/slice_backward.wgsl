// Converts the gradients of a sliced Gaussian to the gradients of its raw scales and rotations, for the training
// passes. CPU reference: `through_sigma` of src/gaussian/gradient.rs; equations: section 7.4 of the 4DGS model.
#define_import_path gs4d::slice_backward

#import gs4d::training::TrainedRecord
#import gs4d::trained::{left_matrix, right_matrix, rotation_3d, Sliced, ROTATED_4D, STATIC_3D}

// Gradients with respect to the logarithms of the scales and to the raw rotations.
struct SliceGradient {
    log_scale: vec4<f32>,
    rotation_l: vec4<f32>,
    rotation_r: vec4<f32>,
}

// Returns the gradients with respect to raw scales and rotations, given the gradients with respect to the conditional
// covariance (symmetric), the velocity c / v and the temporal variance v. `sliced` is the slice of `raw`.
fn through_slice(
    raw: TrainedRecord,
    model: u32,
    sliced: Sliced,
    by_covariance: mat3x3<f32>,
    by_velocity: vec3<f32>,
    by_variance: f32,
) -> SliceGradient {
    let scale = exp(raw.log_scale);
    let squares = scale * scale;
    let l = normalize(raw.rotation_l);
    if model != ROTATED_4D {
        let turn = rotation_3d(l);
        let x = 2.0 * (by_covariance * turn);
        var by_log_scale = vec4(squares.xyz * vec3(dot(x[0], turn[0]), dot(x[1], turn[1]), dot(x[2], turn[2])), 0.0);
        if model != STATIC_3D {
            // In this model the temporal scale is the temporal variance.
            by_log_scale.w = by_variance * sliced.v;
        }
        let by_turn = mat3x3(x[0] * squares.x, x[1] * squares.y, x[2] * squares.z);
        return SliceGradient(by_log_scale, raw_rotation(raw.rotation_l, l, rotation_gradient(l, by_turn)), vec4(0.0));
    }
    let c = sliced.c;
    let v = sliced.v;
    let coupled = by_covariance * c;
    let half_c = (0.5 * by_velocity - coupled) / v;
    let by_v = by_variance + (dot(c, coupled) - dot(c, by_velocity)) / (v * v);
    let by_sigma = mat4x4(
        vec4(by_covariance[0], half_c.x),
        vec4(by_covariance[1], half_c.y),
        vec4(by_covariance[2], half_c.z),
        vec4(half_c, by_v),
    );
    let r = normalize(raw.rotation_r);
    let left = left_matrix(l);
    let right = right_matrix(r);
    let turn = left * right;
    let x = 2.0 * (by_sigma * turn);
    let columns = vec4(dot(x[0], turn[0]), dot(x[1], turn[1]), dot(x[2], turn[2]), dot(x[3], turn[3]));
    let by_turn = mat4x4(x[0] * squares.x, x[1] * squares.y, x[2] * squares.z, x[3] * squares.w);
    return SliceGradient(
        squares * columns,
        raw_rotation(raw.rotation_l, l, left_gradient(by_turn * transpose(right))),
        raw_rotation(raw.rotation_r, r, right_gradient(transpose(left) * by_turn)),
    );
}

fn is_finite(v: vec4<f32>) -> bool {
    // The comparison is false for NaN.
    return all(abs(v) <= vec4(3.4e38));
}

fn is_finite_slice(gradient: SliceGradient) -> bool {
    return is_finite(gradient.log_scale) && is_finite(gradient.rotation_l) && is_finite(gradient.rotation_r);
}

// Returns the gradient with respect to a raw quaternion, given the gradient with respect to its unit quaternion.
fn raw_rotation(raw: vec4<f32>, unit: vec4<f32>, gradient: vec4<f32>) -> vec4<f32> {
    return (gradient - unit * dot(unit, gradient)) / length(raw);
}

// `left_gradient` and `right_gradient` return the gradients with respect to l and r, given the gradients with respect
// to the matrices L and R of `left_matrix` and `right_matrix`. Matrices are m[column][row].
fn left_gradient(h: mat4x4<f32>) -> vec4<f32> {
    return vec4(
        h[0][0] + h[1][1] + h[2][2] + h[3][3],
        h[1][0] - h[0][1] + h[3][2] - h[2][3],
        -h[2][0] + h[3][1] + h[0][2] - h[1][3],
        h[3][0] + h[2][1] - h[1][2] - h[0][3],
    );
}

fn right_gradient(k: mat4x4<f32>) -> vec4<f32> {
    return vec4(
        k[0][0] + k[1][1] + k[2][2] + k[3][3],
        k[1][0] - k[0][1] - k[3][2] + k[2][3],
        -k[2][0] - k[3][1] + k[0][2] + k[1][3],
        -k[3][0] + k[2][1] - k[1][2] + k[0][3],
    );
}

// Returns the gradient with respect to a unit quaternion, given the gradient g[column][row] with respect to its
// rotation matrix.
fn rotation_gradient(q: vec4<f32>, g: mat3x3<f32>) -> vec4<f32> {
    let w = q.x;
    let x = q.y;
    let y = q.z;
    let z = q.w;
    let g01 = g[1][0];
    let g02 = g[2][0];
    let g10 = g[0][1];
    let g12 = g[2][1];
    let g20 = g[0][2];
    let g21 = g[1][2];
    return 2.0 * vec4(
        -z * g01 + y * g02 + z * g10 - x * g12 - y * g20 + x * g21,
        y * g01 + z * g02 + y * g10 - 2.0 * x * g[1][1] - w * g12 + z * g20 + w * g21 - 2.0 * x * g[2][2],
        -2.0 * y * g[0][0] + x * g01 + w * g02 + x * g10 + z * g12 - w * g20 + z * g21 - 2.0 * y * g[2][2],
        -2.0 * z * g[0][0] - w * g01 + x * g02 + w * g10 - 2.0 * z * g[1][1] + y * g12 + x * g20 + y * g21,
    );
}
