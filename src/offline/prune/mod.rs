//! Pruning: which Gaussians are kept.
//!
//! In: scores, and views that were held out from scoring. Out: the Gaussians of the highest scores; the score and the
//! count that a loss allows.
//!
//! | module | subject |
//! |---|---|
//! | `select` | keeps the Gaussians of the highest scores |
//! | `by_views` | scores, then prunes |
//! | `search`, `smallest_count` | the best score, and the smallest count within a loss of PSNR |
//! | `ablation` | the loss by every score, ratio and temporal filter |

pub(crate) mod ablation;
pub(crate) mod by_views;
mod error;
pub(crate) mod search;
pub(crate) mod select;
pub(crate) mod smallest_count;

pub use ablation::{AblationRow, AblationSettings, ablate};
pub use by_views::{PruneSettings, Pruned, prune_by_views};
pub use error::{PruneError, ValidatedChoice};
pub use search::{Candidate, ComparedWith, Goal, Outcome, ScoreChoice, SearchSummary};
pub use smallest_count::Trial;
