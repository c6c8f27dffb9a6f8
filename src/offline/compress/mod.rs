//! Compression: from a scene ready to draw to the packed form.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene) and [`CompressSettings`], or a [`Quality`] that selects them.
//! Out: a scene in the packed form, its Gaussians in Morton order and without levels of detail, and a
//! [`CompressReport`].
//!
//! | file | subject |
//! |---|---|
//! | `settings` | how much may be lost: every option, and the qualities that select them |
//! | `pack` | from a scene to its packed form |
//! | `reorder` | from a packed scene to the same scene in another order |
//! | `codebook`, `coded_colors` | training codebooks, and the colors of a scene by codebooks |
//! | `roundings` | what packing changes of each Gaussian |
//! | `promise` | what a quality promises, and whether a package keeps it |

pub(crate) mod codebook;
mod coded_colors;
mod error;
mod pack;
mod promise;
mod reorder;
pub(crate) mod roundings;
mod settings;

pub(crate) use coded_colors::train_codebooks;
pub use error::CompressError;
pub use pack::{CompressReport, compress};
pub(crate) use pack::{compress_tied, compress_with, require_unpacked};
pub(crate) use promise::broken_promises;
pub use reorder::reorder;
pub(crate) use roundings::roundings;
pub use settings::{CompressSettings, PackedOrder, Quality};
