//! Progress of work, its interruption, and files that are written whole or not at all.
//!
//! In: tasks that begin, advance and end; bytes to be written. Out: the [`Progress`] that the caller displays, an error
//! if the user has asked to end; files that are whole or absent, also if the process is killed.
//!
//! | file | subject |
//! |---|---|
//! | `progress`, `interrupted` | progress and interruption |
//! | `file_error` | an error with the name of its file |
//! | `save` | writes a file beside its destination and renames it |
//! | `temporary_file`, `unfinished` | files that are removed if a process ends before its work |
//! | `node` | tells whether two paths are one file |

mod file_error;
mod interrupted;
pub(crate) mod node;
pub(crate) mod progress;
pub(crate) mod save;
pub(crate) mod temporary_file;
pub(crate) mod unfinished;

pub use file_error::FileError;
pub use interrupted::Interrupted;
pub(crate) use progress::proceed;
pub use progress::{NoProgress, Progress};
pub use save::save;
pub(crate) use save::{save_chunk, save_one_file, write_beside, write_png, write_settings};
