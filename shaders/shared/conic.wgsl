// The covariance of a splat on the screen and its inverse, the conic. In: a covariance in capture space and the rows of
// the projection. Out: the covariance on the screen with the low-pass, its determinant, and the conic in factored form,
// all of them finite and positive definite. CPU reference: src/gaussian/conic.rs, which says why the conic is factored:
//
//     d^T S^-1 d = x (dx + y dy)^2 + z dy^2        x = Syy / det,  y = -Sxy / Syy,  z = 1 / Syy
#define_import_path gs4d::conic

// Added to both variances on the screen, pixels squared.
const LOW_PASS: f32 = 0.3;
// Splats of a larger variance along x or y are not drawn, pixels squared. Squares of this number are finite.
const MAX_VARIANCE: f32 = 1e18;
// Below this ratio of the determinant to the product of the variances, the determinant is computed from cofactors.
const THIN: f32 = 0.00390625;

// Returns the covariance on the screen: xx, xy, yy, pixels squared. Negative variances, which rounding can produce,
// count as 0.
fn screen_covariance(covariance: mat3x3<f32>, row_x: vec3<f32>, row_y: vec3<f32>) -> vec3<f32> {
    let cx = covariance * row_x;
    return vec3(
        max(dot(row_x, cx), 0.0) + LOW_PASS,
        dot(row_y, cx),
        max(dot(row_y, covariance * row_y), 0.0) + LOW_PASS,
    );
}

// Returns whether a splat with this covariance on the screen is drawn. The comparison is false for NaN.
fn is_drawable(screen: vec3<f32>) -> bool {
    return all(abs(screen) <= vec3(MAX_VARIANCE));
}

// Returns the determinant of a covariance on the screen, positive.
fn determinant_of(screen: vec3<f32>, covariance: mat3x3<f32>, row_x: vec3<f32>, row_y: vec3<f32>) -> f32 {
    let product = screen.x * screen.z;
    let det = product - screen.y * screen.y;
    if det < product * THIN {
        return flat_determinant(covariance, row_x, row_y, product) + LOW_PASS * (screen.x + screen.z - LOW_PASS);
    }
    return det;
}

// Returns the determinant without the low-pass, between 0 and `most`: n^T adj(S) n with the cross product n of the rows
// and the cofactors adj(S) of the covariance in capture space.
fn flat_determinant(covariance: mat3x3<f32>, row_x: vec3<f32>, row_y: vec3<f32>, most: f32) -> f32 {
    let diagonal = vec3(covariance[0].x, covariance[1].y, covariance[2].z);
    // yz, xz, xy
    let other = vec3(covariance[1].z, covariance[0].z, covariance[0].y);
    let squares = difference(diagonal.yxx, diagonal.zzy, other, other);
    let mixed = difference(other.yzz, other.xxy, vec3(other.zy, diagonal.x), vec3(diagonal.zy, other.x));
    let n = difference(row_x.yzx, row_y.zxy, row_x.zxy, row_y.yzx);
    let flat = dot(squares, n * n) + 2.0 * dot(mixed, n.xxy * n.yzz);
    // The comparison is false for NaN.
    if flat > 0.0 {
        return min(flat, most);
    }
    return 0.0;
}

// Returns a b - c d without cancellation of rounding errors, by fused multiply-adds.
fn difference(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, d: vec3<f32>) -> vec3<f32> {
    let cd = c * d;
    let error = fma(-c, d, cd);
    return fma(a, b, -cd) + error;
}

// Returns the inverse of a covariance on the screen, factored.
fn conic_of(screen: vec3<f32>, det: f32) -> vec3<f32> {
    return vec3(screen.z / det, -screen.y / screen.z, 1.0 / screen.z);
}

// Returns the determinant with low-passes smaller by `less` along x and y; not below 0.
fn determinant_with_less(screen: vec3<f32>, det: f32, less: vec2<f32>) -> f32 {
    return max(det - screen.x * less.y - screen.z * less.x + less.x * less.y, 0.0);
}

// Returns the exponent of the falloff of a splat at an offset, pixels: at most 0.
fn exponent_at(conic: vec3<f32>, offset: vec2<f32>) -> f32 {
    let along = offset.x + conic.y * offset.y;
    return -0.5 * (conic.x * along * along + conic.z * offset.y * offset.y);
}

// Returns the entries xx, xy, yy of a factored conic.
fn conic_entries(conic: vec3<f32>) -> vec3<f32> {
    let xy = conic.x * conic.y;
    return vec3(conic.x, xy, conic.z + xy * conic.y);
}
