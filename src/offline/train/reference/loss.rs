//! The loss of a view; CPU reference of `shaders/offline/loss.wgsl`.
//!
//! In: a picture and its image. Out: `(1 - share) L1 + share (1 - SSIM)`, the opacity mask, and their gradients with
//! respect to each pixel (section 6 of the 4DGS model).

use crate::offline::dataset::CoveredImage;
use crate::offline::measure::metrics::{SizeMismatch, similarity_slopes};
use crate::view::{Frame, Picture};
use glam::{DVec3, Vec3};

/// The loss of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct Loss {
    /// Its value.
    pub value: f64,
    /// Its gradient with respect to each pixel.
    pub gradient: Vec<Vec3>,
}

/// Computes the loss of a picture, whose values are not clamped.
///
/// # Errors
/// [`SizeMismatch`] if the pictures do not have the same size, or are empty.
pub fn loss(picture: &Picture, image: &Picture, similarity_share: f64) -> Result<Loss, SizeMismatch> {
    let (similarity, slopes) = similarity_slopes(picture, image)?;
    let values = 3.0 * picture.pixels.len() as f64;
    let differences = picture.pixels.iter().zip(&image.pixels).map(|(a, b)| a.as_dvec3() - b.as_dvec3());
    let absolute: f64 = differences.clone().map(|difference| difference.abs().element_sum()).sum::<f64>() / values;
    // The derivative of the absolute value is 0 at 0.
    let sign = |d: DVec3| DVec3::new(sign(d.x), sign(d.y), sign(d.z));
    let gradient = differences.zip(slopes).map(|(difference, slope)| {
        ((1.0 - similarity_share) / values * sign(difference) - similarity_share * slope).as_vec3()
    });
    let value = (1.0 - similarity_share) * absolute + similarity_share * (1.0 - similarity);
    Ok(Loss { value, gradient: gradient.collect() })
}

/// Opacity is clamped to this distance from 0 and 1 in the mask.
const MARGIN: f64 = 1e-6;

/// Opacity where an image covers nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct OpacityMask {
    /// The mean over pixels of `−(1 − coverage) ln(1 − opacity)`.
    pub value: f64,
    /// Its gradient with respect to the opacity of each pixel, one minus the transmittance.
    pub gradient: Vec<f32>,
}

/// Computes the opacity mask of a view.
///
/// # Errors
/// [`SizeMismatch`] if frame and image do not have the same size, or are empty.
pub fn opacity_mask(frame: &Frame, image: &CoveredImage) -> Result<OpacityMask, SizeMismatch> {
    let (size, count) = (frame.picture.size, image.texels.len());
    if size != image.size || count == 0 || frame.transmittance.len() != count {
        return Err(SizeMismatch { first: size, second: image.size });
    }
    let mut mask = OpacityMask { value: 0.0, gradient: Vec::with_capacity(count) };
    for (&transmittance, texel) in frame.transmittance.iter().zip(&image.texels) {
        let share = (1.0 - f64::from(texel[3]) / 255.0) / count as f64;
        let transmittance = f64::from(transmittance);
        let left = transmittance.clamp(MARGIN, 1.0 - MARGIN);
        mask.value -= share * left.ln();
        // A clamped opacity has no gradient.
        mask.gradient.push(if left == transmittance { (share / left) as f32 } else { 0.0 });
    }
    Ok(mask)
}

fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Counts;
    use glam::UVec2;

    fn picture(seed: usize) -> Picture {
        let size = UVec2::new(19, 14);
        let value = |i: usize| (i * seed % 89) as f32 / 89.0;
        let pixels = (0..19 * 14).map(|i| Vec3::new(value(3 * i), value(3 * i + 1), value(3 * i + 2))).collect();
        Picture { size, pixels }
    }

    #[test]
    fn the_gradient_is_that_of_finite_differences() {
        let (mut picture, image) = (picture(31), picture(57));
        let found = loss(&picture, &image, 0.2).expect("the same size");
        for (index, channel) in [(0, 0), (100, 1), (265, 2)] {
            let at = picture.pixels[index][channel];
            let mut value = |moved: f32| {
                picture.pixels[index][channel] = at + moved;
                let value = loss(&picture, &image, 0.2).expect("the same size").value;
                picture.pixels[index][channel] = at;
                value
            };
            let slope = (value(1e-3) - value(-1e-3)) / f64::from((at + 1e-3) - (at - 1e-3));
            let gradient = f64::from(found.gradient[index][channel]);
            assert!((slope - gradient).abs() <= 1e-3 * gradient.abs() + 1e-8, "{slope} is {gradient}");
        }
    }

    #[test]
    fn the_mask_lowers_opacity_where_nothing_is_covered() {
        let size = UVec2::new(4, 1);
        let picture = Picture { size, pixels: vec![Vec3::ZERO; 4] };
        let covered = |coverage: u8| [0, 0, 0, coverage];
        let image = CoveredImage { size, texels: [255, 0, 51, 0].map(covered).to_vec(), has_gaps: true };
        let mask = |transmittance: [f32; 4]| {
            let frame = Frame {
                picture: picture.clone(),
                transmittance: transmittance.to_vec(),
                depth: Vec::new(),
                median_depth: Vec::new(),
                counts: Counts::default(),
            };
            opacity_mask(&frame, &image).expect("the same size")
        };
        let left = [0.25, 0.5, 0.125, 1.0];
        let found = mask(left);
        let expected = -(f64::ln(0.5) + 0.8 * f64::ln(0.125)) / 4.0;
        assert!((found.value - expected).abs() < 1e-5, "{} is {expected}", found.value);
        for index in 0..3 {
            let [low, high] = [-1e-3, 1e-3].map(|step: f32| {
                let mut moved = left;
                moved[index] -= step;
                mask(moved).value
            });
            let (slope, gradient) = ((high - low) / 2e-3, f64::from(found.gradient[index]));
            assert!((slope - gradient).abs() < 1e-3 * (1.0 + gradient), "pixel {index}: {slope} is {gradient}");
        }
        assert_eq!((found.gradient[0], found.gradient[3]), (0.0, 0.0), "none where covered or empty");
        let other = CoveredImage { size: UVec2::new(1, 4), ..image.clone() };
        let frame = Frame {
            picture,
            transmittance: left.to_vec(),
            depth: Vec::new(),
            median_depth: Vec::new(),
            counts: Counts::default(),
        };
        assert!(opacity_mask(&frame, &other).is_err(), "another size");
    }

    #[test]
    fn equal_pictures_have_no_loss() {
        let found = loss(&picture(31), &picture(31), 0.2).expect("the same size");
        assert!(found.value.abs() < 1e-12, "loss {}", found.value);
        assert!(found.gradient.iter().all(|g| g.abs().max_element() < 1e-9), "nowhere to go");
    }
}
