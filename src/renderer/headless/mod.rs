//! Drawing without a window: for commands, scoring and tests.
//!
//! In: scenes and views. Out: [`Headless`], which returns pictures and timings on the host.

mod measure;
mod render;

pub use render::Headless;
