//! `motion`: the motion of each splat on the screen since the previous frame; CPU reference of `shaders/motion.wgsl`.
//!
//! In: a [`Layer`] with its splats, and its view in the previous frame. Out: one motion for each Gaussian, which
//! [`blend`](super::blend()) blends in place of a color.

use super::{Layer, Splat};
use crate::view::View;
use glam::Vec2;

/// Returns the motion of every splat in pixels, to the right and down; 0 for an invisible splat, and for a splat that
/// was not in front of the camera in the previous frame.
pub fn motion(layer: &Layer<'_>, splats: &[Splat], previous: &View) -> Vec<Vec2> {
    let [clip_x, clip_y] = previous.clip_rows();
    let size = layer.view.size.as_vec2();
    let moved = |(index, splat): (usize, &Splat)| {
        if !splat.is_visible() {
            return Vec2::ZERO;
        }
        let mean = layer.scene.gaussian(index).mean_at(previous.time).extend(1.0);
        let depth = previous.world_to_camera.row(2).dot(mean);
        if depth <= previous.near {
            return Vec2::ZERO;
        }
        let divisor = if previous.orthographic { 1.0 } else { depth + 1e-7 };
        let ndc = Vec2::new(clip_x.dot(mean), clip_y.dot(mean)) / divisor;
        let before = ((ndc + 1.0) * size - 1.0) * 0.5;
        (splat.center - before).clamp(-size, size)
    };
    splats.iter().enumerate().map(moved).collect()
}
