//! The report of a bake, for people and for programs.
//!
//! In: the results of the stages of a bake. Out: a [`BakeReport`], as JSON and as one self-contained HTML page.

mod bake_report;
pub(super) mod escape;
pub(crate) mod files;
mod html;
pub(crate) mod plot;
pub(crate) mod temporal;

pub use bake_report::{BakeReport, Change, Sample, SectionSize, StageTime, Tried};
pub(crate) use files::{report_paths, write_with_report};
pub use temporal::{Activity, VarianceHistogram};
pub(crate) use temporal::{even_times, filter_shares};
