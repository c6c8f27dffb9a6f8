//! The CPU references of the passes of training.
//!
//! In: what a pass reads. Out: what it writes, by the same formulas. A file has the name of its shader in
//! `shaders/offline/`, or names it; the rules that come from papers are explained here.

pub(crate) mod adam;
pub(crate) mod births;
pub(crate) mod cloning;
pub(crate) mod dropout;
pub(crate) mod environment_backward;
pub(crate) mod error_peaks;
pub(crate) mod exposure;
pub(crate) mod floaters;
pub(crate) mod loss;
pub(crate) mod neighbors;
pub(crate) mod noise;
pub(crate) mod pinhole;
pub(crate) mod random_words;
pub(crate) mod relocation;
pub(crate) mod standing;
pub(crate) mod terms;
pub(crate) mod triangulation;
