//! A picture beside its reference.
//!
//! In: two pictures of the same size. Out: one picture of both and their difference.

use crate::view::Picture;
use glam::{UVec2, Vec3};

/// Returns reference, render and their difference times `gain`, side by side. Both must have the same size.
pub(crate) fn side_by_side(reference: &Picture, render: &Picture, gain: f32) -> Picture {
    let render = render.clamped();
    let difference: Vec<Vec3> =
        reference.pixels.iter().zip(&render.pixels).map(|(p, q)| ((*p - *q).abs() * gain).min(Vec3::ONE)).collect();
    let width = reference.size.x.max(1) as usize;
    let rows = reference.pixels.chunks(width).zip(render.pixels.chunks(width)).zip(difference.chunks(width));
    let pixels = rows.flat_map(|((a, b), c)| [a, b, c].concat()).collect();
    Picture { size: UVec2::new(reference.size.x * 3, reference.size.y), pixels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reference_render_and_difference_lie_side_by_side() {
        let a = Picture::filled(UVec2::new(2, 2), Vec3::splat(0.5));
        let b = Picture::filled(UVec2::new(2, 2), Vec3::new(0.5, 0.25, 2.0));
        let all = side_by_side(&a, &b, 2.0);
        assert_eq!(all.size, UVec2::new(6, 2), "three pictures");
        assert_eq!(all.pixel(1, 1), Vec3::splat(0.5), "the reference");
        assert_eq!(all.pixel(2, 0), Vec3::new(0.5, 0.25, 1.0), "the render, clamped");
        assert_eq!(all.pixel(5, 1), Vec3::new(0.0, 0.5, 1.0), "twice the difference, clamped");
    }
}
