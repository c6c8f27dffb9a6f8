//! The reports of one bake and of many, for people and for programs.
//!
//! In: the results of the stages of a bake. Out: a [`BakeReport`], as JSON and as one self-contained HTML page; in
//! `fleet`, the reports of many bakes on one page.
//!
//! | file | subject |
//! |---|---|
//! | `bake_report`, `temporal` | the contents of the report of a bake; activity over time |
//! | `files` | its files beside the package |
//! | `bake_page`, `plot` | its page, and plots as SVG |
//! | `html`, `page.css` | what all pages have in common |
//! | `fleet` | the report over many bakes |

mod bake_page;
mod bake_report;
mod error;
mod files;
pub(crate) mod fleet;
mod html;
mod plot;
mod temporal;

pub use crate::offline::store::stages::StageTime;
pub use bake_report::{BakeReport, Change, Sample, SectionSize, Tried};
pub use error::ReportError;
pub(crate) use files::{report_paths, write_with_report};
pub use temporal::{Activity, VarianceHistogram};
pub(crate) use temporal::{even_times, filter_shares};
