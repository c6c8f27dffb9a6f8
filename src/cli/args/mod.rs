//! Groups of options that several verbs share, and how the values of options are spelled.
//!
//! In: the part of the command line that belongs to a group. Out: settings of the library, or what it opens with them.

mod checkpoint;
mod data;
mod engine;
mod given;
mod package;
mod scoring;
pub mod values;
mod views;

pub use checkpoint::CheckpointArgs;
pub use data::{DataArgs, SplitArgs, ValidationArgs};
pub use engine::{DesignArgs, EngineArgs, RendererArgs, RenderersArgs};
pub use given::{Given, WITHOUT_TIME};
pub use package::{PackageArgs, file_size};
pub use scoring::{ScoringArgs, score_choice};
pub use views::ViewArgs;
