//! The report over many bakes.
//!
//! In: paths of packages, and the reports of their bakes beside them. Out: a [`FleetReport`]: the figures of every
//! package, the outliers among them, and the packages that are missing or damaged; as JSON, as comma-separated values,
//! and as one self-contained HTML page.
//!
//! | file | content |
//! |---|---|
//! | `find.rs` | from files and folders to the paths of packages |
//! | `bake.rs` | the results of one bake: figures, notes, or a failure |
//! | `stored_report.rs` | the part of `NAME.report.json` that is read |
//! | `measure.rs` | the figures that bakes are compared by |
//! | `outliers.rs` | which figures are outliers |
//! | `fleet_report.rs` | all of it, as JSON and as comma-separated values |
//! | `page.rs`, `page.css`, `page.js` | the page |
//! | `strip.rs` | the distribution of a figure as a drawing |

mod bake;
mod find;
mod fleet_report;
mod measure;
mod outliers;
mod page;
mod stored_report;
mod strip;

pub(crate) use bake::Bake;
pub(crate) use find::find_packages;
pub(crate) use fleet_report::FleetReport;
pub(crate) use measure::{MEASURES, Measure};
