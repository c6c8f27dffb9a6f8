//! Drawing on the GPU or, without a hardware GPU, by the CPU reference.
//!
//! In: [`EngineSettings`]. Out: an [`Engine`], which draws a scene from many views ([`Draw`]); an error if the pictures
//! do not fit the memory or the GPU, before the first picture is loaded or drawn.
//!
//! | file | subject |
//! |---|---|
//! | `choice` | chooses between GPU and CPU |
//! | `memory` | checks that pictures fit the memory and the GPU |
//! | `shaders`, `layout` | compose the passes of scoring and training, and mirror their structures |

pub(crate) mod choice;
mod error;
pub(crate) mod layout;
pub(crate) mod memory;
mod purpose;
pub(crate) mod shaders;

pub(crate) use choice::drawing_on_gpu;
pub use choice::{AdapterDescription, Draw, Engine, EngineChoice, EngineSettings, GpuSettings};
pub use error::EngineError;
pub use purpose::Purpose;
