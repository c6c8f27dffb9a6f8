//! Distortion of lenses, undone once when an image is loaded.
//!
//! In: the coefficients of a lens by OpenCV's formulas, and a distorted image. Out: the image of a pinhole camera, in
//! which each pixel is sampled from the distorted image (bilinear, in stored values times coverage).
//!
//! The pinhole camera has the lens of the file, with longer focal lengths if parts of its image would lie outside the
//! distorted image. So every pixel has a source. A distortion that needs more than twice the focal length is refused.

use crate::offline::dataset::FrameProblem;
use crate::view::Lens;
use glam::{DVec2, UVec2};
use rayon::prelude::*;

/// Largest factor of the focal lengths.
const MAX_ZOOM: f64 = 2.0;
/// Bisections of the factor.
const BISECTIONS: usize = 12;
/// Checked points of each side of the picture.
const POINTS: usize = 4;
/// Checked points between the center and a point of a side.
const STEPS: usize = 4;

/// The coefficients of a lens. Default: all 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Distortion {
    /// Whether the radial coefficients belong to the fisheye formula, which has no others.
    pub fisheye: bool,
    /// Radial coefficients of r², r⁴, r⁶ and r⁸ (fisheye: of θ², θ⁴, θ⁶ and θ⁸).
    pub radial: [f64; 4],
    /// Radial coefficients of the denominator, of r², r⁴ and r⁶.
    pub denominator: [f64; 3],
    /// Tangential coefficients, p1 and p2.
    pub tangential: [f64; 2],
}

impl Distortion {
    /// Returns whether nothing is distorted. A fisheye lens without coefficients is not a pinhole.
    fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the distorted place of a point of the plane at distance 1.
    fn forward(&self, DVec2 { x, y }: DVec2) -> DVec2 {
        let r2 = x * x + y * y;
        if self.fisheye {
            let r = r2.sqrt();
            let angle = r.atan();
            let a2 = angle * angle;
            let [k1, k2, k3, k4] = self.radial;
            let distorted = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
            // Near the center the ratio tends to 1.
            let ratio = if r > 1e-12 { distorted / r } else { 1.0 };
            return DVec2::new(x, y) * ratio;
        }
        let [k1, k2, k3, k4] = self.radial;
        let [d1, d2, d3] = self.denominator;
        let [p1, p2] = self.tangential;
        let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))) / (1.0 + r2 * (d1 + r2 * (d2 + r2 * d3)));
        DVec2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// Returns whether the distorted distance grows from the center to a point, so that the picture is not folded
    /// between them.
    fn grows_to(&self, at: DVec2) -> bool {
        let mut last = self.forward(DVec2::ZERO);
        (1..=STEPS).all(|step| {
            let next = self.forward(at * (step as f64 / STEPS as f64));
            let grows = next.is_finite() && (next - last).dot(at) > 0.0;
            last = next;
            grows
        })
    }
}

/// A lens and its distortion, with lengths in sides of the picture, so that the size of the picture does not matter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Undistortion {
    distortion: Distortion,
    focal: DVec2,
    center: DVec2,
    /// Factor of the focal lengths of the pinhole camera.
    zoom: f64,
}

impl Undistortion {
    /// Returns the correction for pictures of a lens of this size; `None` if nothing is distorted.
    pub(crate) fn new(distortion: Distortion, lens: Lens, size: UVec2) -> Result<Option<Self>, FrameProblem> {
        if distortion.is_none() {
            return Ok(None);
        }
        let (focal, center) = match lens {
            Lens::Fov { tan } => (0.5 / tan.as_dvec2(), DVec2::splat(0.5)),
            Lens::Intrinsics { focal, center } => {
                (focal.as_dvec2() / size.as_dvec2(), center.as_dvec2() / size.as_dvec2())
            }
        };
        let zoomed = |zoom| Self { distortion, focal, center, zoom };
        let (mut low, mut high) = (1.0, MAX_ZOOM);
        if zoomed(low).has_sources() {
            return Ok(Some(zoomed(low)));
        }
        if !zoomed(high).has_sources() {
            return Err(FrameProblem::Folded);
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if zoomed(middle).has_sources() { high = middle } else { low = middle }
        }
        Ok(Some(zoomed(high)))
    }

    /// Returns the lens of the pinhole camera.
    pub(crate) fn pinhole(&self, lens: Lens) -> Lens {
        let zoom = self.zoom as f32;
        match lens {
            Lens::Fov { tan } => Lens::Fov { tan: tan / zoom },
            Lens::Intrinsics { focal, center } => Lens::Intrinsics { focal: focal * zoom, center },
        }
    }

    /// Returns the place in the distorted image of a place in the image of the pinhole camera, both in sides of the
    /// picture.
    fn source(&self, at: DVec2) -> DVec2 {
        self.distortion.forward(self.on_plane(at)) * self.focal + self.center
    }

    fn on_plane(&self, at: DVec2) -> DVec2 {
        (at - self.center) / (self.focal * self.zoom)
    }

    /// Returns whether every point of the picture's sides has a source in the distorted image.
    fn has_sources(&self) -> bool {
        let mut sides = (0..POINTS).flat_map(|point| {
            let t = point as f64 / POINTS as f64;
            [DVec2::new(t, 0.0), DVec2::new(1.0, t), DVec2::new(1.0 - t, 1.0), DVec2::new(0.0, 1.0 - t)]
        });
        let inside = |at: DVec2| at.min_element() >= -1e-9 && at.max_element() <= 1.0 + 1e-9;
        sides.all(|at| inside(self.source(at)) && self.distortion.grows_to(self.on_plane(at)))
    }

    /// Returns the image of the pinhole camera: for each of its pixels the bilinear sample of the distorted image,
    /// whose channels are interleaved.
    pub(crate) fn undistort(&self, bytes: &[u8], channels: usize, size: UVec2) -> Vec<u8> {
        let (width, height) = (size.x as usize, size.y as usize);
        let mut undone = vec![0; bytes.len()];
        let row_length = (width * channels).max(1);
        undone.par_chunks_mut(row_length).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(channels).enumerate() {
                let at = self.source(DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / size.as_dvec2());
                let at = (at * size.as_dvec2() - 0.5).clamp(DVec2::ZERO, (size - 1).as_dvec2());
                let (column, line) = (at.x as usize, at.y as usize);
                let (next_column, next_line) = ((column + 1).min(width - 1), (line + 1).min(height - 1));
                let part = at.fract();
                for (channel, value) in pixel.iter_mut().enumerate() {
                    let stored = |x: usize, y: usize| f64::from(bytes[(y * width + x) * channels + channel]);
                    let across = |y: usize| stored(column, y) * (1.0 - part.x) + stored(next_column, y) * part.x;
                    *value = (across(line) * (1.0 - part.y) + across(next_line) * part.y).round() as u8;
                }
            }
        });
        undone
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    const SIZE: UVec2 = UVec2::new(64, 48);

    fn lens() -> Lens {
        Lens::Intrinsics { focal: Vec2::new(50.0, 52.0), center: Vec2::new(31.0, 25.0) }
    }

    fn undistortion(distortion: Distortion) -> Undistortion {
        Undistortion::new(distortion, lens(), SIZE).expect("the distortion can be undone").expect("it is not zero")
    }

    #[test]
    fn the_formulas_have_the_values_of_opencv() {
        // Computed by hand for x = 0.3, y = −0.2: r² = 0.13, so r⁴ = 0.0169 and r⁶ = 0.002197.
        let radial = Distortion { radial: [0.1, -0.05, 0.01, 0.0], tangential: [0.002, -0.003], ..Default::default() };
        let factor = 1.0 + 0.1 * 0.13 - 0.05 * 0.0169 + 0.01 * 0.002_197;
        let x = 0.3 * factor + 2.0 * 0.002 * 0.3 * -0.2 - 0.003 * (0.13 + 2.0 * 0.09);
        let y = -0.2 * factor + 0.002 * (0.13 + 2.0 * 0.04) + 2.0 * -0.003 * 0.3 * -0.2;
        let found = radial.forward(DVec2::new(0.3, -0.2));
        assert!(found.abs_diff_eq(DVec2::new(x, y), 1e-12), "the radial formula is {x} {y}: {found}");
        // At 45 degrees r = 1 and θ = π/4.
        let fisheye = Distortion { fisheye: true, radial: [0.1, 0.0, 0.0, 0.02], ..Default::default() };
        let angle = std::f64::consts::FRAC_PI_4;
        let expected = angle * (1.0 + 0.1 * angle.powi(2) + 0.02 * angle.powi(8));
        let found = fisheye.forward(DVec2::new(0.6, 0.8));
        assert!(
            found.abs_diff_eq(DVec2::new(0.6, 0.8) * expected, 1e-12),
            "the fisheye formula scales by {expected}: {found}"
        );
    }

    #[test]
    fn a_straight_line_is_straight_after_its_distortion_is_undone() {
        for distortion in [
            Distortion { radial: [-0.2, 0.03, 0.0, 0.0], tangential: [0.001, 0.002], ..Default::default() },
            Distortion { radial: [0.15, 0.0, 0.0, 0.0], ..Default::default() },
            Distortion { fisheye: true, radial: [0.02, -0.01, 0.0, 0.0], ..Default::default() },
        ] {
            let undo = undistortion(distortion);
            // The scene is a ramp over x / z: distorted pixels are found by inverting the formula by fixed-point steps.
            let ramp = |plane: DVec2| 128.0 + 90.0 * plane.x + 30.0 * plane.y;
            let mut bytes = Vec::new();
            for pixel in 0..SIZE.x * SIZE.y {
                let at = (DVec2::new(f64::from(pixel % SIZE.x), f64::from(pixel / SIZE.x)) + 0.5) / SIZE.as_dvec2();
                let target = (at - undo.center) / undo.focal;
                let mut plane = target;
                for _ in 0..60 {
                    plane += 0.7 * (target - distortion.forward(plane));
                }
                bytes.push(ramp(plane).round() as u8);
            }
            let undone = undo.undistort(&bytes, 1, SIZE);
            let mut worst = 0.0f64;
            for pixel in 0..SIZE.x * SIZE.y {
                let at = (DVec2::new(f64::from(pixel % SIZE.x), f64::from(pixel / SIZE.x)) + 0.5) / SIZE.as_dvec2();
                let plane = undo.on_plane(at);
                worst = worst.max((f64::from(undone[pixel as usize]) - ramp(plane)).abs());
            }
            assert!(
                worst <= 2.0,
                "the ramp is linear in the image of the pinhole camera ({distortion:?}): off by {worst}"
            );
        }
    }

    #[test]
    fn the_pinhole_camera_has_longer_focal_lengths_where_the_image_ends() {
        let barrel = undistortion(Distortion { radial: [-0.1, 0.0, 0.0, 0.0], ..Default::default() });
        assert_eq!(barrel.zoom, 1.0, "a barrel distortion has a source for every pixel");
        let cushion = undistortion(Distortion { radial: [0.1, 0.0, 0.0, 0.0], ..Default::default() });
        assert!(cushion.zoom > 1.01 && cushion.zoom < 1.2, "the corners are outside: {}", cushion.zoom);
        let Lens::Intrinsics { focal, center } = cushion.pinhole(lens()) else { panic!("the kind of lens is kept") };
        assert!((f64::from(focal.x) - 50.0 * cushion.zoom).abs() < 1e-4, "the focal length is scaled: {focal}");
        assert_eq!(center, Vec2::new(31.0, 25.0), "the principal point is kept");
    }

    #[test]
    fn a_distortion_that_folds_the_picture_is_refused() {
        let folded = Distortion { radial: [-9.0, 0.0, 0.0, 0.0], ..Default::default() };
        let problem = Undistortion::new(folded, lens(), SIZE).expect_err("the picture is folded");
        assert!(matches!(problem, FrameProblem::Folded), "the reason is named: {problem}");
        let none = Undistortion::new(Distortion::default(), lens(), SIZE).expect("no distortion is valid");
        assert_eq!(none, None, "without distortion nothing is undone");
    }
}
