//! Groups of options that several verbs share, and how the values of options are spelled.
//!
//! In: the part of the command line that belongs to a group. Out: settings of the library, or the engine, scene or
//! views that are opened with them.

mod checkpoint;
mod data;
mod effects;
mod engine;
mod given;
mod order;
mod package;
mod scoring;
mod shards;
mod training;
pub(super) mod values;
mod views;

pub(super) use checkpoint::CheckpointArgs;
pub(super) use data::{DataArgs, SplitArgs, ValidationArgs};
pub(super) use effects::Need;
#[cfg(test)]
pub(super) use effects::RULES;
pub(super) use engine::{DesignArgs, EngineArgs, RendererArgs, RenderersArgs};
pub(super) use given::Given;
pub(super) use order::OrderArgs;
pub(super) use package::{PackageArgs, file_size};
pub(super) use scoring::{ScoringArgs, score_choice};
pub(super) use shards::{PART, Portion, ShardArgs};
pub(super) use training::TrainingArgs;
pub(super) use views::ViewArgs;
