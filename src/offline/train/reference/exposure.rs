//! Exposures of cameras: a correction of the color of every picture of a camera; CPU reference of
//! `shaders/offline/exposure.wgsl`.
//!
//! In: a drawn frame, the exposure of its camera, the gradient of a loss with respect to the corrected picture. Out:
//! the corrected picture; the gradients with respect to the drawn frame and to the exposure. A pixel with the color `c`
//! of the scene, without the background, and with the opacity `o` becomes
//!
//! ```text
//! M c + b o
//! ```
//!
//! so that a background color does not change: it is put behind the images after they are taken. An environment map
//! is part of the scene, and `o` is then 1. `M` and `b` are the columns of a matrix of three rows (3DGS has the same,
//! for opaque pictures). Where a scene exists before the first step, exposures begin at their least squares ([`Fit`]).

use crate::view::{Frame, Picture};
use glam::{DMat4, DVec3, DVec4, Vec3};

/// An exposure: for red, green and blue the factors on red, green and blue, and the offset of an opaque pixel.
pub type Exposure = [[f32; 4]; 3];

/// The exposure that changes nothing.
pub const IDENTITY: Exposure = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Weight, in the loss of a view, of the sum of the squared differences between the exposure of its camera and
/// [`IDENTITY`]: so weak that a difference which the images show costs little.
pub const PULL: f32 = 1e-3;

/// Weight, in the mean squared error of a pixel, of the squared differences between a fitted exposure and
/// [`IDENTITY`]: it decides for colors that a camera does not show.
const FIT_PULL: f64 = 1e-4;

/// The exposure that fits the drawn frames of a camera to its images: that of the least squared error.
#[derive(Debug, Clone, Copy)]
pub struct Fit {
    /// Sums over pixels of the products of the color and the opacity of the scene.
    own: DMat4,
    /// Sums of their products with red, green and blue of the images.
    image: [DVec4; 3],
    pixels: f64,
}

impl Default for Fit {
    fn default() -> Self {
        Self { own: DMat4::ZERO, image: [DVec4::ZERO; 3], pixels: 0.0 }
    }
}

impl Fit {
    /// Adds a drawn frame and the image of the same view over the same background. `background` is as in [`exposed`].
    pub fn add(&mut self, frame: &Frame, image: &Picture, background: Option<Vec3>) {
        let drawn = frame.picture.pixels.iter().zip(&frame.transmittance);
        for ((color, transmittance), image) in drawn.zip(&image.pixels) {
            let (own, opacity, behind) = of_scene(*color, *transmittance, background);
            let (own, image) = (own.extend(opacity), (image.as_dvec3() - behind).to_array());
            self.own += DMat4::from_cols(own * own.x, own * own.y, own * own.z, own * own.w);
            self.image = std::array::from_fn(|channel| self.image[channel] + own * image[channel]);
            self.pixels += 1.0;
        }
    }

    /// Returns the exposure; [`IDENTITY`] without pixels.
    pub fn exposure(&self) -> Exposure {
        let pull = FIT_PULL * self.pixels.max(1.0);
        let inverse = (self.own + DMat4::from_diagonal(DVec4::splat(pull))).inverse();
        std::array::from_fn(|channel| {
            let identity = DVec4::from_array(IDENTITY[channel].map(f64::from));
            (inverse * (self.image[channel] + pull * identity)).as_vec4().to_array()
        })
    }
}

/// The gradients of a loss.
#[derive(Debug, Clone, PartialEq)]
pub struct ExposureGradient {
    /// With respect to red, green, blue and opacity of each pixel of the frame.
    pub pixels: Vec<[f32; 4]>,
    /// With respect to the exposure.
    pub exposure: [[f64; 4]; 3],
}

/// Returns the corrected picture of a frame. `background` is the color behind the scene; `None` if an environment map
/// is.
pub fn exposed(frame: &Frame, exposure: &Exposure, background: Option<Vec3>) -> Picture {
    let corrected = |(color, transmittance): (&Vec3, &f32)| {
        let (own, opacity, behind) = of_scene(*color, *transmittance, background);
        (behind + DVec3::from_array(exposure.map(|row| corrected(row, own, opacity)))).as_vec3()
    };
    let pixels = frame.picture.pixels.iter().zip(&frame.transmittance).map(corrected).collect();
    Picture { size: frame.picture.size, pixels }
}

/// Returns the gradients of a loss. `gradient` is that with respect to each pixel of the corrected picture.
pub fn exposure_backward(
    frame: &Frame,
    exposure: &Exposure,
    background: Option<Vec3>,
    gradient: &[Vec3],
) -> ExposureGradient {
    let mut sums = [[0.0; 4]; 3];
    let behind = background.map(Vec3::as_dvec3);
    let rows = exposure.map(|row| row.map(f64::from));
    let drawn = frame.picture.pixels.iter().zip(&frame.transmittance);
    let pixel = |((color, transmittance), gradient): ((&Vec3, &f32), &Vec3)| {
        let (own, opacity, _) = of_scene(*color, *transmittance, background);
        let gradient = gradient.as_dvec3();
        let mut by_own = [0.0; 4];
        for (channel, (sums, row)) in sums.iter_mut().zip(&rows).enumerate() {
            for (k, value) in [own.x, own.y, own.z, opacity].into_iter().enumerate() {
                sums[k] += gradient[channel] * value;
                by_own[k] += gradient[channel] * row[k];
            }
        }
        let [r, g, b, by_opacity] = by_own;
        // With more opacity, less of the drawn color is the background's: more of it is corrected.
        let by_opacity =
            behind.map_or(0.0, |behind| by_opacity + DVec3::new(r, g, b).dot(behind) - gradient.dot(behind));
        [r, g, b, by_opacity].map(|value| value as f32)
    };
    let pixels = drawn.zip(gradient).map(pixel).collect();
    ExposureGradient { pixels, exposure: sums }
}

/// Returns the term of the loss that pulls an exposure to [`IDENTITY`], and its gradient.
pub fn pull(exposure: &Exposure) -> (f64, [[f64; 4]; 3]) {
    let mut gradient = [[0.0; 4]; 3];
    let mut value = 0.0;
    let values = exposure.as_flattened().iter().zip(IDENTITY.as_flattened());
    for (gradient, (own, identity)) in gradient.as_flattened_mut().iter_mut().zip(values) {
        let difference = f64::from(own - identity);
        value += f64::from(PULL) * difference * difference;
        *gradient = 2.0 * f64::from(PULL) * difference;
    }
    (value, gradient)
}

/// Adds the same to all exposures, so that their mean is [`IDENTITY`]: the capture has the mean exposure of the
/// cameras. Otherwise brighter colors and darker exposures would have the same loss, and the capture, which is drawn
/// without exposures, could have any brightness.
pub fn center(exposures: &mut [Exposure]) {
    let mut means = [[0.0; 4]; 3];
    for exposure in &*exposures {
        let values = exposure.as_flattened().iter().zip(IDENTITY.as_flattened());
        for (mean, (own, identity)) in means.as_flattened_mut().iter_mut().zip(values) {
            *mean += f64::from(own - identity) / exposures.len() as f64;
        }
    }
    for exposure in exposures {
        for (own, mean) in exposure.as_flattened_mut().iter_mut().zip(means.as_flattened()) {
            *own -= *mean as f32;
        }
    }
}

/// Returns the color of the scene in a pixel, its opacity, and what the background adds.
fn of_scene(color: Vec3, transmittance: f32, background: Option<Vec3>) -> (DVec3, f64, DVec3) {
    let behind = background.map_or(DVec3::ZERO, |background| f64::from(transmittance) * background.as_dvec3());
    let opacity = background.map_or(1.0, |_| 1.0 - f64::from(transmittance));
    (color.as_dvec3() - behind, opacity, behind)
}

/// Returns one channel of a corrected pixel.
fn corrected(row: [f32; 4], own: DVec3, opacity: f64) -> f64 {
    let [r, g, b, offset] = row.map(f64::from);
    DVec3::new(r, g, b).dot(own) + offset * opacity
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::train::reference::loss::loss;
    use crate::view::Counts;
    use glam::UVec2;

    const SIZE: UVec2 = UVec2::new(13, 9);
    const PIXELS: usize = 117;
    const OTHER: Exposure = [[1.2, 0.05, -0.02, 0.03], [0.01, 0.8, 0.04, -0.02], [-0.03, 0.02, 1.1, 0.05]];

    fn value(i: usize, seed: usize) -> f32 {
        (i * seed % 89) as f32 / 89.0
    }

    fn frame() -> Frame {
        let pixels = (0..PIXELS).map(|i| Vec3::new(value(i, 31), value(i, 17), value(i, 53))).collect();
        Frame {
            picture: Picture { size: SIZE, pixels },
            transmittance: (0..PIXELS).map(|i| value(i, 23)).collect(),
            depth: Vec::new(),
            median_depth: Vec::new(),
            counts: Counts::default(),
        }
    }

    fn image() -> Picture {
        let pixels = (0..PIXELS).map(|i| Vec3::new(value(i, 41), value(i, 7), value(i, 67))).collect();
        Picture { size: SIZE, pixels }
    }

    #[test]
    fn an_exposure_changes_the_scene_and_not_the_background() {
        let mut frame = frame();
        let behind = Vec3::new(0.25, 0.5, 1.0);
        let same = exposed(&frame, &IDENTITY, Some(behind));
        let error = same.pixels.iter().zip(&frame.picture.pixels).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(error < 1e-6, "the identity changes nothing: {error}");
        (frame.picture.pixels[5], frame.transmittance[5]) = (behind, 1.0);
        (frame.picture.pixels[6], frame.transmittance[6]) = (Vec3::new(0.5, 0.25, 0.0), 0.0);
        let found = exposed(&frame, &OTHER, Some(behind)).pixels;
        assert!(found[5].distance(behind) < 1e-6, "an empty pixel keeps the background: {}", found[5]);
        let opaque = Vec3::new(0.6 + 0.0125 + 0.03, 0.005 + 0.2 - 0.02, -0.015 + 0.005 + 0.05);
        assert!(found[6].distance(opaque) < 1e-6, "an opaque pixel: {}, expected {opaque}", found[6]);
        let surrounded = exposed(&frame, &OTHER, None).pixels[5];
        let row = |row: [f32; 4]| row[0] * 0.25 + row[1] * 0.5 + row[2] + row[3];
        let expected = Vec3::from(OTHER.map(row));
        assert!(surrounded.distance(expected) < 1e-6, "an environment map is exposed: {surrounded}, not {expected}");
    }

    #[test]
    fn a_fit_finds_the_exposure_of_images() {
        let (black, picture) = (Picture { size: SIZE, pixels: vec![Vec3::ZERO; PIXELS] }, frame());
        for background in [Some(Vec3::new(0.3, 0.6, 0.1)), None] {
            let mut fit = Fit::default();
            assert_eq!(fit.exposure(), IDENTITY, "without pixels");
            fit.add(&picture, &exposed(&picture, &OTHER, background), background);
            let found = fit.exposure();
            let pairs = found.as_flattened().iter().zip(OTHER.as_flattened());
            let error = pairs.map(|(found, own)| (found - own).abs()).fold(0.0, f32::max);
            assert!(error < 0.01, "{found:?} over {background:?}, not {OTHER:?}");
        }
        // Without any green the factors on green stay as they are.
        let mut red = picture;
        red.picture.pixels.iter_mut().for_each(|color| (color.y, color.z) = (0.0, 0.0));
        red.transmittance.fill(0.0);
        let mut fit = Fit::default();
        fit.add(&red, &black, Some(Vec3::ZERO));
        let [own, green, _] = fit.exposure();
        assert!(own[0].abs() < 0.01 && (green[1] - 1.0).abs() < 1e-3, "{own:?}, {green:?}");
    }

    #[test]
    fn the_gradients_are_those_of_finite_differences() {
        let image = image();
        for background in [Some(Vec3::new(0.3, 0.6, 0.1)), None] {
            let of = |frame: &Frame, exposure: &Exposure| {
                loss(&exposed(frame, exposure, background), &image, 0.2).expect("the same size")
            };
            let frame = frame();
            let found = exposure_backward(&frame, &OTHER, background, &of(&frame, &OTHER).gradient);
            let pulled = pull(&OTHER).1;
            for place in 0..12 {
                let moved = |by: f32| {
                    let mut exposure = OTHER;
                    exposure.as_flattened_mut()[place] += by;
                    of(&frame, &exposure).value + pull(&exposure).0
                };
                let slope = (moved(1e-3) - moved(-1e-3)) / 2e-3;
                let gradient = found.exposure.as_flattened()[place] + pulled.as_flattened()[place];
                assert!((slope - gradient).abs() < 1e-3 * gradient.abs() + 1e-5, "{place}: {slope} is {gradient}");
            }
            for index in [0, 40, 116] {
                for place in 0..4 {
                    // Opacity moves while the drawn color stays.
                    let moved = |by: f32| {
                        let mut frame = frame.clone();
                        match place {
                            3 => frame.transmittance[index] -= by,
                            channel => frame.picture.pixels[index][channel] += by,
                        }
                        of(&frame, &OTHER).value
                    };
                    let (slope, gradient) =
                        ((moved(1e-3) - moved(-1e-3)) / 2e-3, f64::from(found.pixels[index][place]));
                    let error = (slope - gradient).abs();
                    assert!(error < 1e-2 * gradient.abs() + 1e-6, "pixel {index}, {place}: {slope} is {gradient}");
                }
            }
        }
    }

    #[test]
    fn the_mean_exposure_is_the_identity() {
        let mut exposures = [OTHER, IDENTITY, [[0.5; 4]; 3]];
        let before = exposures;
        center(&mut exposures);
        for place in 0..12 {
            let mean = exposures.iter().map(|exposure| exposure.as_flattened()[place]).sum::<f32>() / 3.0;
            assert!((mean - IDENTITY.as_flattened()[place]).abs() < 1e-6, "value {place} has the mean {mean}");
            let of = |exposures: &[Exposure]| exposures[0].as_flattened()[place] - exposures[2].as_flattened()[place];
            assert!((of(&exposures) - of(&before)).abs() < 1e-6, "differences of value {place} stay");
        }
        center(&mut []);
    }
}
