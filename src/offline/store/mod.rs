//! Results on disk, from which work resumes, and parts of work that is divided among machines.
//!
//! In: the stages of a bake or the share of one machine, with everything that their results depend on. Out: stored
//! results, found again by their key; merged parts of a computation; outputs that overwrite no input.
//!
//! | module | subject |
//! |---|---|
//! | `outputs` | refuses outputs that are inputs or cannot be written, before anything is computed |
//! | `results`, `stored` | the folder of results, and how each type of result is written and read |
//! | `stages` | runs the stages whose results are not stored yet |
//! | `shard` | divides work among machines, and checks that their parts belong together |

mod error;
pub(crate) mod outputs;
pub(crate) mod results;
pub(crate) mod shard;
pub(crate) mod stages;
pub(crate) mod stored;

pub use error::StoreError;
