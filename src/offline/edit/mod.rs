//! Edits of a capture that ask what its training cameras see.
//!
//! In: a capture, the views of a dataset. Out: how many cameras see each Gaussian, for the edits that ask for it.
//! [`codec::read_edits`](crate::codec::read_edits) reads a list of edits, and [`scene::edit`](crate::scene::edit) applies
//! it.

mod cameras;
mod error;

pub use cameras::seen_by;
pub use error::SeenError;
