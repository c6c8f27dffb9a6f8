//! The CPU twin of every GPU pass, with the same names and in the same order.
//!
//! In: a [`RuntimeScene`], a [`View`] and a [`Background`]. Out: a [`Frame`]. Plain functions over slices, to be laid beside
//! `shaders/`: [`project()`], [`sort`], [`bin`], `sort` again, [`ranges`], [`blend`]; or [`score()`] in place of the last.

mod bin;
mod blend;
mod project;
mod score;
mod sort;

pub use bin::{Pair, bin, ranges};
pub use blend::blend;
pub use project::{Splat, project};
pub use score::{ViewScore, Want, score};
pub use sort::sort;

use crate::frame::{Background, Counts, Frame};
use crate::gaussian::View;
use crate::scene::RuntimeScene;
use std::ops::Range;

/// Draws a view on the CPU.
pub fn render(scene: &RuntimeScene, view: &View, background: Background) -> Frame {
    let splats = project(scene, view);
    let Lists { pairs, ranges, visible } = lists(&splats, view);
    let counts = Counts { visible, pairs: pairs.len() as u32 };
    let environment = scene.environment.as_ref();
    blend(&splats, &pairs, &ranges, view, background, environment, counts)
}

/// The splats of every tile, front to back.
struct Lists {
    pairs: Vec<Pair>,
    ranges: Vec<Range<usize>>,
    visible: u32,
}

/// Everything between `project` and the last pass.
fn lists(splats: &[Splat], view: &View) -> Lists {
    let mut order: Vec<u32> = (0..splats.len() as u32).filter(|&i| splats[i as usize].is_visible()).collect();
    sort(&mut order, |&i| splats[i as usize].depth.to_bits());
    let mut pairs = bin(splats, &order, view.tiles());
    sort(&mut pairs, |pair| pair.tile);
    let ranges = ranges(&pairs, view.tiles());
    Lists { pairs, ranges, visible: order.len() as u32 }
}
