//! The gradient of a loss with respect to the environment map; CPU reference of
//! `shaders/offline/environment_backward.wgsl`.
//!
//! In: a map, a view, for each pixel its transmittance and the gradient of the loss with respect to its color. Out: the
//! gradient with respect to each value of the map: transmittance times bilinear weight times gradient, summed over
//! pixels.

use crate::scene::Environment;
use crate::view::View;
use glam::Vec3;

/// Returns the gradient with respect to each value of the map, planar as [`Environment::texels`].
///
/// # Panics
/// If there are fewer pixels than the view has.
pub fn environment_backward(map: &Environment, view: &View, transmittance: &[f32], pixels: &[Vec3]) -> Vec<f64> {
    let plane = (map.width * map.height) as usize;
    let mut gradient = vec![0.0; 3 * plane];
    for index in 0..view.size.x * view.size.y {
        let (left, pixel) = (transmittance[index as usize], pixels[index as usize]);
        let ray = view.ray(index % view.size.x, index / view.size.x);
        for (texel, weight) in map.weights(view.camera_position, ray) {
            let share = f64::from(left) * f64::from(weight) * pixel.as_dvec3();
            (0..3).for_each(|channel| gradient[channel * plane + texel] += share[channel]);
        }
    }
    gradient
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};
    use glam::UVec2;

    #[test]
    fn the_gradient_is_that_of_finite_differences() {
        let texels = (0..3 * 12 * 6).map(|i| (i * 37 % 101) as f32 / 101.0).collect();
        let mut map = Environment { width: 12, height: 6, texels };
        let size = UVec2::new(9, 7);
        let view = Camera::look_at(Vec3::new(2.0, 3.0, 1.0), Vec3::ZERO, Vec3::Z, 1.9, size);
        let view = view.view(0.0, RasterFov::Corrected);
        let value = |i: usize, seed: usize| ((i * seed) % 53) as f32 / 53.0;
        let transmittance: Vec<f32> = (0..63).map(|i| value(i, 29)).collect();
        let pixels: Vec<Vec3> = (0..63).map(|i| Vec3::new(value(i, 7), -value(i, 11), value(i, 13))).collect();
        let loss = |map: &Environment| -> f64 {
            let pixel = |i: u32| {
                let color = map.sample(view.camera_position, view.ray(i % size.x, i / size.x));
                f64::from(transmittance[i as usize]) * pixels[i as usize].as_dvec3().dot(color.as_dvec3())
            };
            (0..63).map(pixel).sum()
        };
        let found = environment_backward(&map, &view, &transmittance, &pixels);
        assert!(found.iter().filter(|&&gradient| gradient != 0.0).count() > 30, "many texels are seen: {found:?}");
        for (index, found) in found.iter().enumerate() {
            let at = map.texels[index];
            let mut moved = |by: f32| {
                map.texels[index] = at + by;
                loss(&map)
            };
            let expected = (moved(0.125) - moved(-0.125)) / 0.25;
            map.texels[index] = at;
            assert!((found - expected).abs() < 1e-5, "value {index}: {found}, expected {expected}");
        }
    }
}
