//! glTF files with `KHR_gaussian_splatting`, as text (`.gltf`) or binary (`.glb`).
//!
//! In: the bytes of a file, the buffers beside it. Out: a scene with the Gaussians of all nodes. `container` splits a
//! file into its JSON and its binary chunk, `document` is the JSON, `buffers` and `accessors` find the numbers, `nodes`
//! the transformations, `primitive` the Gaussians of a mesh, `work` limits how often they are repeated, `color` converts
//! linear colors, `read` puts all together.

mod accessors;
mod buffers;
mod color;
mod container;
mod document;
mod nodes;
mod primitive;
mod read;
mod work;

pub(crate) use container::is_of;
pub(crate) use read::read;
