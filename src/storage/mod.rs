//! Object storage, servers and URLs in place of the files of the command.
//!
//! In: the command line of `gs4d` with URLs (`s3://bucket/key`, `https://host/path`, `file:///path`) for inputs and outputs. Out: the same
//! command on copies: inputs are fetched to a cache before the verb runs, outputs are uploaded whole once it has succeeded.
//!
//! ```text
//! s3://bucket/in.pth ──▶ cache/objects/ ──▶ cache/sets/../in.pth ──▶ verb ──▶ cache/outputs/../out.gs4d ──▶ s3://bucket/out.gs4d
//! ```
//!
//! | file | content |
//! |---|---|
//! | `arguments.rs` | paths in place of URLs in a command line |
//! | `place.rs` | a URL: its store, its path there |
//! | `store_error.rs` | errors of stores as sentences |
//! | `cache.rs` | the folder of copies |
//! | `listing.rs` | the objects that an input URL stands for |
//! | `fetch.rs` | from an object to a file, by ranges |
//! | `upload.rs` | from files to objects, each whole |
//! | `remote.rs` | the command on URLs |

mod arguments;
mod cache;
mod fetch;
mod listing;
mod place;
mod remote;
mod store_error;
mod upload;

pub use remote::run;
