//! The loss of a view; CPU reference of `shaders/loss.wgsl`.
//!
//! In: a picture and its image. Out: `(1 - share) L1 + share (1 - SSIM)` and its gradient with respect to each pixel (section 6 of the 4DGS
//! model).

use crate::offline::metrics::{SizeMismatch, similarity_slopes};
use crate::view::Picture;
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

fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

#[cfg(test)]
mod tests {
    use super::*;
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
    fn equal_pictures_have_no_loss() {
        let found = loss(&picture(31), &picture(31), 0.2).expect("the same size");
        assert!(found.value.abs() < 1e-12, "loss {}", found.value);
        assert!(found.gradient.iter().all(|g| g.abs().max_element() < 1e-9), "nowhere to go");
    }
}
