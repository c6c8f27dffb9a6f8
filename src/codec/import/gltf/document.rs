//! The JSON of a glTF file, as far as Gaussians need it.
//!
//! In: text. Out: [`Document`]. Other properties are ignored; indices are checked where they are used.

use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Document {
    pub scene: Option<usize>,
    pub scenes: Vec<Scene>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    pub accessors: Vec<Accessor>,
    pub buffer_views: Vec<BufferView>,
    pub buffers: Vec<Buffer>,
    pub animations: Vec<Animation>,
    pub extensions_required: Vec<String>,
}

/// The roots of a hierarchy of nodes.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub nodes: Vec<usize>,
}

/// A node: a matrix, or a translation, a rotation x, y, z, w and a scale.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub mesh: Option<usize>,
    pub children: Vec<usize>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub primitives: Vec<Primitive>,
}

/// A primitive: its attributes, by the indices of their accessors.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub mode: Option<u32>,
    pub attributes: BTreeMap<String, usize>,
    pub extensions: PrimitiveExtensions,
}

/// The extensions of a primitive.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_gaussian_splatting")]
    pub splatting: Option<Splatting>,
}

/// The extension `KHR_gaussian_splatting`.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Splatting {
    pub kernel: Option<String>,
    pub color_space: Option<String>,
    pub projection: Option<String>,
    pub extensions: SplattingExtensions,
}

/// The extensions of `KHR_gaussian_splatting`.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct SplattingExtensions {
    #[serde(rename = "KHR_gaussian_splatting_compression_spz_2")]
    pub spz: Option<Compressed>,
}

/// A file of another format in a buffer view.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Compressed {
    pub buffer_view: usize,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Accessor {
    pub buffer_view: Option<usize>,
    pub byte_offset: usize,
    pub component_type: u32,
    pub normalized: bool,
    pub count: usize,
    #[serde(rename = "type")]
    pub shape: String,
    pub sparse: Option<serde::de::IgnoredAny>,
}

/// A part of a buffer.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct BufferView {
    pub buffer: usize,
    pub byte_offset: usize,
    pub byte_length: usize,
    pub byte_stride: Option<usize>,
    /// By name: extensions that compress the view are refused.
    pub extensions: BTreeMap<String, serde::de::IgnoredAny>,
}

/// A buffer: a file, a data URI, or the binary chunk if it has no URI.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Buffer {
    pub uri: Option<String>,
    pub byte_length: usize,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub channels: Vec<Channel>,
    pub samplers: Vec<Sampler>,
}

/// The property of a node that a sampler moves.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Channel {
    pub sampler: usize,
    pub target: Target,
}

/// A property of a node.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Target {
    pub node: Option<usize>,
    pub path: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Sampler {
    pub output: usize,
    pub interpolation: Option<String>,
}
