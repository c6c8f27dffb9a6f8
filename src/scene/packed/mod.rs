//! The packed form: the result of [`encode`], which the GPU reads without unpacking it in memory.
//!
//! In: quantized records of 32 bytes, ranges to decode them with, and colors, whole or coded by codebooks. Out: any one
//! Gaussian or color, decoded as `shaders/shared/packed.wgsl` decodes it.
//!
//! | file | content |
//! |---|---|
//! | `scene.rs` | the packed form, and its checks |
//! | `lanes.rs` | the position and the range of each value in a record, for the encoder and the decoder |
//! | `pack.rs` | from a scene to its packed form |
//! | `anchor.rs` | moves temporal means close to the time interval |
//! | `order.rs`, `morton.rs` | the order of the Gaussians: neighbors share a box, layers follow each other |
//! | `strays.rs` | Gaussians far from the others, which have blocks of their own |
//! | `encode.rs`, `additional_bits.rs` | from Gaussians to records and ranges |
//! | `decode.rs` | from records and ranges to Gaussians and colors |
//! | `select.rs` | some of the Gaussians, without a change of their values |
//! | `reorder.rs` | another order of the Gaussians of a packed scene |
//! | `rounding.rs` | the change of a Gaussian by packing |
//! | `coarseness.rs` | whether means are precise enough for the size of their Gaussians |
//! | `shape.rs` | a covariance as scales and a rotation, and back |
//! | `colors.rs`, `codebooks.rs` | colors by codebook, and back |
//! | `runs.rs` | which blocks are in which chunk file |

mod additional_bits;
pub(crate) mod anchor;
mod coarseness;
mod codebooks;
mod colors;
mod decode;
pub(crate) mod encode;
mod lanes;
mod morton;
pub(crate) mod order;
pub(crate) mod pack;
mod reorder;
mod rounding;
pub(crate) mod runs;
mod scene;
mod select;
mod shape;
mod strays;

pub use codebooks::ColorCodebooks;
pub use colors::CodedColors;
pub use encode::Bits;
pub use lanes::{BLOCK, BLOCK_RANGES, COLOR_WORDS, MAX_ENTRIES, MAX_STAGES, RECORD_WORDS, SHARED_RANGES};
pub use pack::{PackError, Packing};
pub use rounding::Rounding;
pub use runs::{RunPart, Runs};
pub(crate) use scene::are_layers;
pub use scene::{PackedColors, PackedScene};
