//! Color: spherindrical harmonics, that is, spherical harmonics whose coefficients are modulated by cosines of time.
//!
//! In: coefficients, a unit direction from the camera to the Gaussian, and `tau = mean_t − time`. Out: the linear
//! combination plus one half, clamped below at 0, in the space the capture was trained in (sRGB-encoded values).

use glam::Vec3;

/// The largest color: the largest half-precision number, as in HDR view targets. As in
/// `shaders/shared/appearance.wgsl`.
pub const BRIGHTEST: f32 = 65504.0;

/// Color coefficients of `N` Gaussians.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Harmonics {
    /// Coefficients stored per Gaussian and channel, K. Time-major: 16 spatial, 16 of the first harmonic, 16 of the
    /// second.
    pub coefficients: usize,
    /// Spatial degree evaluated, 0 to 3.
    pub degree: u32,
    /// Time degree evaluated, 0 to 2; needs `degree` 3.
    pub degree_t: u32,
    /// `N × K × 3` values, RGB innermost.
    pub values: Vec<f32>,
}

/// The mean toward which the viewing direction of the color points. Default: [`Canonical`](Self::Canonical).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShDirection {
    /// The undisplaced mean μ (the original's CUDA path, all shipped configurations).
    #[default]
    Canonical,
    /// The conditional mean at the time that is drawn (the original's Python path).
    Displaced,
}

/// Most coefficients per Gaussian and channel: 16 spatial ones for each of three blocks of time.
pub const MAX_COEFFICIENTS: usize = 48;

/// π, with the digits of the original rasterizer.
#[expect(clippy::approx_constant, reason = "the original's literal, digit for digit")]
const PI: f64 = 3.14159265;

impl Harmonics {
    /// Returns the number of coefficients per Gaussian and channel that are evaluated: 1, 4, 9, 16, 32 or 48.
    pub fn evaluated(&self) -> usize {
        evaluated(self.degree, self.degree_t)
    }

    /// Returns the K × 3 values of one Gaussian.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn of(&self, index: usize) -> &[f32] {
        &self.values[index * self.coefficients * 3..][..self.coefficients * 3]
    }

    /// Lowers the degrees to at most the degrees given and frees the coefficients that are no longer evaluated.
    pub fn truncate(&mut self, degree: u32, degree_t: u32) {
        self.degree = self.degree.min(degree);
        self.degree_t = if self.degree == 3 { self.degree_t.min(degree_t) } else { 0 };
        let keep = self.evaluated();
        if keep < self.coefficients {
            let stride = self.coefficients * 3;
            let count = self.values.len() / stride;
            for i in 0..count {
                self.values.copy_within(i * stride..i * stride + keep * 3, i * keep * 3);
            }
            self.values.truncate(count * keep * 3);
            self.values.shrink_to_fit();
            self.coefficients = keep;
        }
    }

    /// Returns the harmonics of the Gaussians at these indices, in this order.
    ///
    /// # Panics
    /// If an index is out of range.
    pub(crate) fn select(&self, keep: &[u32]) -> Self {
        let mut values = Vec::with_capacity(keep.len() * self.coefficients * 3);
        for &index in keep {
            values.extend_from_slice(self.of(index as usize));
        }
        Self { values, ..*self }
    }

    /// Returns whether the parts fit together for `count` Gaussians: degrees in range, and enough coefficients and
    /// values for them.
    pub fn is_consistent(&self, count: usize) -> bool {
        self.degree <= 3
            && self.degree_t <= 2
            && self.coefficients <= MAX_COEFFICIENTS
            && self.evaluated() <= self.coefficients
            && self.coefficients.checked_mul(3).and_then(|k| k.checked_mul(count)) == Some(self.values.len())
    }

    /// Returns the color of one Gaussian seen along the unit vector `direction` (camera to Gaussian, capture space),
    /// with `tau = mean_t − time`, and `time_span`, the time after which colors repeat
    /// ([`TrainedWith::period_of_colors`](crate::scene::TrainedWith::period_of_colors)), both in timestamp units. Clamped
    /// below at 0.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn color(&self, index: usize, direction: Vec3, tau: f32, time_span: f32) -> Vec3 {
        let basis = basis(direction);
        let sh = self.of(index);
        let block = |first: usize, count: usize| {
            (0..count).fold(Vec3::ZERO, |sum, k| sum + basis[k] * Vec3::from_slice(&sh[(first + k) * 3..]))
        };
        let mut color = block(0, (self.degree as usize + 1).pow(2));
        if self.degree == 3 {
            for n in 1..=self.degree_t as usize {
                color += time_cosine(n, tau, time_span) * block(16 * n, 16);
            }
        }
        (color + 0.5).max(Vec3::ZERO).min(Vec3::splat(BRIGHTEST))
    }
}

/// Returns the number of coefficients per Gaussian and channel of these degrees.
pub fn evaluated(degree: u32, degree_t: u32) -> usize {
    let spatial = (degree as usize + 1).pow(2);
    if degree == 3 { spatial * (1 + degree_t as usize) } else { spatial }
}

/// Returns the factor of harmonic `n` in time: `cos(2π n tau / T)`.
pub fn time_cosine(n: usize, tau: f32, time_span: f32) -> f32 {
    (2.0 * PI * n as f64 * f64::from(tau) / f64::from(time_span)).cos() as f32
}

/// Returns the 16 real spherical harmonics up to degree 3 in the unit direction given, in coefficient order, with the
/// signs of 3DGS.
pub fn basis(direction: Vec3) -> [f32; 16] {
    let Vec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.282_094_79,
        -0.488_602_51 * y,
        0.488_602_51 * z,
        -0.488_602_51 * x,
        1.092_548_4 * x * y,
        -1.092_548_4 * y * z,
        0.315_391_57 * (2.0 * zz - xx - yy),
        -1.092_548_4 * x * z,
        0.546_274_2 * (xx - yy),
        -0.590_043_6 * y * (3.0 * xx - yy),
        2.890_611_4 * x * y * z,
        -0.457_045_8 * y * (4.0 * zz - xx - yy),
        0.373_176_33 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_8 * x * (4.0 * zz - xx - yy),
        1.445_305_7 * z * (xx - yy),
        -0.590_043_6 * x * (xx - 3.0 * yy),
    ]
}
