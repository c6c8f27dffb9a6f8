//! The report of a bake, for people and for programs.
//!
//! In: the results of the stages of a bake. Out: a [`BakeReport`], as JSON and as one self-contained HTML page.

mod bake_report;
mod escape;
mod files;
mod html;
mod plot;
mod temporal;

pub use bake_report::{BakeReport, Change, Sample, SectionSize, StageTime, Tried};
pub use files::{report_paths, write_with_report};
pub use plot::{Axis, Chart, Series, bars};
pub use temporal::{Activity, VarianceHistogram, even_times, filter_shares};
