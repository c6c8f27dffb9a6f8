//! The verbs of the command, a file each.
//!
//! In: the options of a verb. Out: its [`Report`](super::output::report::Report), from a call of
//! [`offline`](crate::offline).

pub(super) mod ablate;
pub(super) mod bake;
pub(super) mod bench;
pub(super) mod collide;
pub(super) mod compare;
pub(super) mod compress;
pub(super) mod convert;
pub(super) mod detail;
pub(super) mod edit;
pub(super) mod eval;
pub(super) mod export;
pub(super) mod fine_tune;
pub(super) mod fleet;
pub(super) mod footage;
pub(super) mod info;
pub(super) mod info_dataset;
pub(super) mod join;
pub(super) mod mask;
pub(super) mod prune;
pub(super) mod render;
pub(super) mod score;
pub(super) mod socket;
pub(super) mod sound;
pub(super) mod split;
pub(super) mod synth;
pub(super) mod train;
