//! A whole frame: all passes in order.
//!
//! In: scenes, views and a background. Out: a [`Frame`].

use super::blend::blend;
use super::layer::Layer;
use super::project::{Splat, project};
use super::tile_lists::{TileLists, tile_lists};
use crate::scene::RuntimeScene;
use crate::view::{Appearance, Background, BlendSpace, Counts, Frame, View};

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
