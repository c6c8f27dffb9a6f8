//! The picture of a contact shadow: a disk with a soft edge.
//!
//! In: its softness. Out: an image for a square around the disk, white, with the shadow in alpha.

use bevy::asset::RenderAssetUsages;
use bevy::image::Image;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use glam::Vec2;

/// Pixels along each side.
const SIDE: u32 = 64;

/// Returns the picture for a softness from 0 to 1.
pub(super) fn gradient(softness: f32) -> Image {
    let size = Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 };
    let pixels = (0..SIDE * SIDE).map(|pixel| {
        let at = Vec2::new((pixel % SIDE) as f32, (pixel / SIDE) as f32) + 0.5;
        shade((at / SIDE as f32 * 2.0 - 1.0).length(), softness)
    });
    let texels = pixels.flat_map(|shade| [255, 255, 255, (shade * 255.0).round() as u8]).collect();
    let format = TextureFormat::Rgba8UnormSrgb;
    Image::new(size, TextureDimension::D2, texels, format, RenderAssetUsages::RENDER_WORLD)
}

/// Returns the shadow, from 0 to 1, at a distance from the middle: 0 from a distance of 1 on.
fn shade(distance: f32, softness: f32) -> f32 {
    // The hardest edge is as wide as a pixel.
    let softness = softness.max(2.0 / SIDE as f32);
    let t = ((1.0 - distance) / softness).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disk_is_dark_inside_and_ends_at_its_edge() {
        for softness in [0.0, 0.5, 1.0] {
            assert_eq!(shade(0.0, softness), 1.0, "{softness}: the middle is in the shadow");
            assert_eq!(shade(1.0, softness), 0.0, "{softness}: the edge is not");
            assert_eq!(shade(1.4, softness), 0.0, "{softness}: nor is the corner");
        }
        assert_eq!(shade(0.5, 0.5), 1.0, "half way out, a soft edge begins");
        assert_eq!(shade(0.75, 0.5), 0.5, "and is half as dark in its middle");
    }

    #[test]
    fn the_picture_is_clear_at_its_border() {
        let image = gradient(0.8);
        let alphas: Vec<u8> = image.data.expect("pixels").chunks(4).map(|pixel| pixel[3]).collect();
        let side = SIDE as usize;
        assert_eq!(alphas.len(), side * side, "a value for each pixel");
        assert!(alphas[..side].iter().all(|alpha| *alpha <= 1), "nothing shows at the border");
        assert!(alphas[side * side / 2 + side / 2] > 250, "all of it does in the middle");
    }
}
