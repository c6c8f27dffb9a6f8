//! Edits of a capture: from their file, and with what its training cameras see.
//!
//! In: a file with an [`EditList`](crate::scene::edit::EditList), the views of a dataset. Out: the list; how many
//! cameras see each Gaussian, for the edits that ask for it. [`scene::edit`](crate::scene::edit) applies the list.
//!
//! | file | subject |
//! |---|---|
//! | `read` | a list from its file |
//! | `cameras` | what cameras see of each Gaussian |

mod cameras;
mod error;
mod read;

pub use cameras::seen_by;
pub use error::SeenError;
pub use read::read_edits;
