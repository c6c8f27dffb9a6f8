//! The covariance of a splat on the screen and its inverse, the conic.
//!
//! In: a covariance in capture space and the rows of the projection. Out: the covariance on the screen with the
//! low-pass, its determinant, and the conic in factored form, all of them finite and positive definite. The CPU
//! reference of `shaders/shared/conic.wgsl`.
//!
//! Both the determinant and the exponent of a splat cancel if they are computed from the entries of the covariance or
//! its inverse. The splat of a needle 300 pixels long would have an alpha with an error of 0.05. Therefore the conic is
//! kept factored,
//!
//! ```text
//! dᵀ Σ⁻¹ d = x (dx + y dy)² + z dy²        x = Σyy / det,  y = −Σxy / Σyy,  z = 1 / Σyy
//! ```
//!
//! a sum of two squares, and the determinant of a thin splat is computed from the cofactors of the covariance in
//! capture space.

use glam::{Mat3, Vec2, Vec3};

/// Added to both variances on the screen, pixels squared.
pub const LOW_PASS: f32 = 0.3;
/// Splats of a larger variance along x or y are not drawn, pixels squared. Squares of this number are finite.
pub const MAX_VARIANCE: f32 = 1e18;
/// Below this ratio of the determinant to the product of the variances, the determinant is computed from cofactors.
pub const THIN: f32 = 1.0 / 256.0;

/// The covariance of a splat on the screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScreenCovariance {
    /// With the low-pass: xx, xy, yy, pixels squared.
    pub entries: Vec3,
    /// Determinant, positive.
    pub determinant: f32,
}

impl ScreenCovariance {
    /// Projects a covariance by the rows of the projection, pixels per unit; `None` above [`MAX_VARIANCE`], or if a
    /// value is not finite. Negative variances, which rounding can produce, count as 0.
    pub fn project(covariance: Mat3, row_x: Vec3, row_y: Vec3) -> Option<Self> {
        let (cx, cy) = (covariance * row_x, covariance * row_y);
        let (xx, xy, yy) = (row_x.dot(cx).max(0.0) + LOW_PASS, row_x.dot(cy), row_y.dot(cy).max(0.0) + LOW_PASS);
        // The comparison is false for NaN.
        if !(xx <= MAX_VARIANCE && xy.abs() <= MAX_VARIANCE && yy <= MAX_VARIANCE) {
            return None;
        }
        let product = xx * yy;
        let mut determinant = product - xy * xy;
        if determinant < product * THIN {
            determinant = flat_determinant(covariance, row_x, row_y, product) + LOW_PASS * (xx + yy - LOW_PASS);
        }
        Some(Self { entries: Vec3::new(xx, xy, yy), determinant })
    }

    /// Returns the inverse, factored.
    pub fn conic(&self) -> Vec3 {
        let Vec3 { y: xy, z: yy, .. } = self.entries;
        Vec3::new(yy / self.determinant, -xy / yy, 1.0 / yy)
    }

    /// Returns the determinant with low-passes smaller by `less` along x and y; not below 0.
    pub fn determinant_with_less(&self, less: Vec2) -> f32 {
        let Vec3 { x: xx, z: yy, .. } = self.entries;
        (self.determinant - xx * less.y - yy * less.x + less.x * less.y).max(0.0)
    }
}

/// Returns the determinant of the covariance on the screen without the low-pass, between 0 and `most`: `nᵀ adj(Σ) n`
/// with the cross product n of the rows and the cofactors adj(Σ).
fn flat_determinant(covariance: Mat3, row_x: Vec3, row_y: Vec3, most: f32) -> f32 {
    let [xx, xy, xz, _, yy, yz, _, _, zz] = covariance.to_cols_array();
    let squares =
        difference(Vec3::new(yy, xx, xx), Vec3::new(zz, zz, yy), Vec3::new(yz, xz, xy), Vec3::new(yz, xz, xy));
    let mixed = difference(Vec3::new(xz, xy, xy), Vec3::new(yz, yz, xz), Vec3::new(xy, xz, xx), Vec3::new(zz, yy, yz));
    let n = difference(
        Vec3::new(row_x.y, row_x.z, row_x.x),
        Vec3::new(row_y.z, row_y.x, row_y.y),
        Vec3::new(row_x.z, row_x.x, row_x.y),
        Vec3::new(row_y.y, row_y.z, row_y.x),
    );
    let flat = squares.dot(n * n) + 2.0 * mixed.dot(Vec3::new(n.x * n.y, n.x * n.z, n.y * n.z));
    // The comparison is false for NaN.
    if flat > 0.0 { flat.min(most) } else { 0.0 }
}

/// Returns `a b − c d` without cancellation of rounding errors, by fused multiply-adds.
fn difference(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> Vec3 {
    let cd = c * d;
    let error = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + error
}

/// Returns the exponent of the falloff of a splat at an offset, pixels: −½ dᵀ Σ⁻¹ d, at most 0. `conic` is factored.
pub fn exponent(conic: Vec3, offset: Vec2) -> f32 {
    let along = offset.x + conic.y * offset.y;
    -0.5 * (conic.x * along * along + conic.z * offset.y * offset.y)
}

/// Returns the entries xx, xy, yy of a factored conic.
pub fn conic_entries(conic: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = conic;
    [x, x * y, z + x * y * y]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec2, DVec3, Quat};

    /// Returns the covariance of a needle `length` long and 1e-3 wide, in a direction that is none of the axes, in
    /// single precision.
    fn needle(length: f32) -> Mat3 {
        let axes = Mat3::from_quat(Quat::from_xyzw(0.3, -0.5, 0.2, 0.6).normalize());
        let scaled = axes * Mat3::from_diagonal(Vec3::new(length, 1e-3, 1e-3));
        scaled * scaled.transpose()
    }

    const ROWS: [Vec3; 2] = [Vec3::new(800.0, 20.0, -90.0), Vec3::new(-15.0, 790.0, 60.0)];

    /// Returns the covariance on the screen in double precision.
    fn exact(covariance: Mat3) -> [f64; 3] {
        let [x, y] = ROWS.map(|row| row.as_dvec3());
        let matrix: DMat3 = covariance.as_dmat3();
        let of = |a: DVec3, b: DVec3| a.dot(matrix * b);
        let low_pass = f64::from(LOW_PASS);
        [of(x, x) + low_pass, of(x, y), of(y, y) + low_pass]
    }

    #[test]
    fn determinants_of_thin_splats_match_double_precision() {
        for length in [1e-3, 0.02, 0.1, 0.3, 1.0] {
            let covariance = needle(length);
            let [xx, xy, yy] = exact(covariance);
            let wanted = xx * yy - xy * xy;
            let found = ScreenCovariance::project(covariance, ROWS[0], ROWS[1]).expect("the needle is drawn");
            let error = (f64::from(found.determinant) / wanted - 1.0).abs();
            assert!(error < 2e-3, "needle of {length}: {} for {wanted}", found.determinant);
        }
    }

    #[test]
    fn exponents_of_thin_splats_match_double_precision() {
        for length in [0.02, 0.1, 0.3, 1.0] {
            let covariance = needle(length);
            let [xx, xy, yy] = exact(covariance);
            let determinant = xx * yy - xy * xy;
            let conic = ScreenCovariance::project(covariance, ROWS[0], ROWS[1]).expect("the needle is drawn").conic();
            let along = DVec2::new(xx.sqrt(), xy / xx.sqrt());
            for step in -20..=20 {
                let offset = (along * (f64::from(step) * 0.1) + DVec2::new(0.2, -0.3)).as_vec2();
                let d = offset.as_dvec2();
                let wanted = -0.5 * (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / determinant;
                let error = (f64::from(exponent(conic, offset)) - wanted).abs();
                assert!(error < 4e-3, "needle of {length} at {offset}: off by {error}");
            }
        }
    }

    #[test]
    fn covariances_that_are_not_definite_give_an_ellipse() {
        let along = Vec3::new(1.0, 1.0, 1.0);
        // The exact product is of rank one; smaller entries on the diagonal make it indefinite.
        let indefinite = Mat3::from_cols(along, along, along) * 100.0 - Mat3::from_diagonal(Vec3::splat(1e-3));
        let found = ScreenCovariance::project(indefinite, ROWS[0], ROWS[1]).expect("the splat is drawn");
        assert!(found.determinant > 0.0, "the determinant is positive: {}", found.determinant);
        let conic = found.conic();
        assert!(conic.is_finite() && conic.x > 0.0 && conic.z > 0.0, "the conic is an ellipse: {conic}");
    }

    #[test]
    fn covariances_beyond_the_limit_are_refused() {
        for scale in [1e13, 1e20, 1e38, f32::INFINITY, f32::NAN] {
            let covariance = Mat3::from_diagonal(Vec3::splat(scale));
            assert_eq!(ScreenCovariance::project(covariance, ROWS[0], ROWS[1]), None, "a variance of {scale}");
        }
    }

    #[test]
    fn entries_of_a_factored_conic_are_those_of_the_inverse() {
        let covariance = ScreenCovariance { entries: Vec3::new(4.0, 1.0, 9.0), determinant: 35.0 };
        let [xx, xy, yy] = conic_entries(covariance.conic().to_array().map(f64::from));
        for (found, wanted) in [(xx, 9.0 / 35.0), (xy, -1.0 / 35.0), (yy, 4.0 / 35.0)] {
            assert!((found - wanted).abs() < 1e-7, "{found} is {wanted}");
        }
    }
}
