//! The CPU reference of every GPU pass of a frame, with the same names and in the same order.
//!
//! In: [`Layer`]s and a [`Background`]. Out: a [`Frame`]. Plain functions over slices, which correspond to the files of
//! `shaders/`: [`activate()`], [`project()`], [`sort`], [`bin`], `sort` again, [`ranges`], [`blend`], [`motion()`]. And back from the
//! gradient of a loss on a frame to that of the trained parameters: [`blend_backward()`], [`gradients`].

mod activate;
mod bin;
mod blend;
mod blend_backward;
mod motion;
mod project;
mod sort;
mod workload;

pub use activate::activate;
pub use bin::{Pair, bin, ranges};
pub use blend::{behind, blend};
pub use blend_backward::{PixelGradients, blend_backward, gradients};
pub use motion::motion;
pub use project::{Splat, project};
pub use sort::sort;
pub use workload::{Workload, workload};

use crate::scene::RuntimeScene;
use crate::view::{Appearance, Background, BlendSpace, Counts, Frame, View};
use std::ops::Range;

/// A scene, and how it is shown in a view.
#[derive(Debug, Clone, Copy)]
pub struct Layer<'a> {
    /// The scene.
    pub scene: &'a RuntimeScene,
    /// Camera and time, with the transform of the scene.
    pub view: View,
    /// How it is shown.
    pub appearance: Appearance,
}

/// Draws a view of one scene on the CPU, as trained.
pub fn render(scene: &RuntimeScene, view: &View, background: Background) -> Frame {
    let layer = Layer { scene, view: *view, appearance: Appearance::default() };
    render_layers(&[layer], background, BlendSpace::Encoded)
}

/// Draws scenes into one picture, sorted together. All views must have the same size and lens.
///
/// # Panics
/// If `layers` is empty.
pub fn render_layers(layers: &[Layer<'_>], background: Background, space: BlendSpace) -> Frame {
    let view = &layers[0].view;
    let splats: Vec<Splat> = layers.iter().flat_map(|layer| project(layer, space)).collect();
    let TileLists { pairs, ranges, visible } = tile_lists(&splats, view);
    let counts = Counts { visible, pairs: pairs.len() as u32 };
    let surrounded = layers.iter().find_map(|layer| Some((layer, layer.scene.environment.as_ref()?)));
    let outside = surrounded.map_or(view, |(layer, _)| &layer.view);
    let environment = surrounded.map(|(layer, map)| (map, layer.appearance));
    blend(&splats, &pairs, &ranges, outside, background, environment, space, counts)
}

/// The splats of every tile of a view, front to back.
#[derive(Debug)]
pub struct TileLists {
    /// All pairs, ordered by tile, then depth, then index.
    pub pairs: Vec<Pair>,
    /// The range of each tile in `pairs`.
    pub ranges: Vec<Range<usize>>,
    /// Number of splats that cover at least one tile.
    pub visible: u32,
}

/// Runs what is between `project` and the last pass: `sort` by depth, `bin`, `sort` by tile, `ranges`.
pub fn tile_lists(splats: &[Splat], view: &View) -> TileLists {
    let mut order: Vec<u32> = (0..splats.len() as u32).filter(|&i| splats[i as usize].is_visible()).collect();
    // Positive floats have the same order as their bits. Depths are taken from the near plane of an orthographic
    // camera, which may be behind it.
    let nearest = if view.orthographic { view.near } else { 0.0 };
    sort(&mut order, |&i| (splats[i as usize].depth - nearest).to_bits());
    let mut pairs = bin(splats, &order, view.tiles());
    sort(&mut pairs, |pair| pair.tile);
    let ranges = ranges(&pairs, view.tiles());
    TileLists { pairs, ranges, visible: order.len() as u32 }
}
