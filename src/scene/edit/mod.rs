//! Editing without loss: a small list of edits, which is applied to a capture.
//!
//! In: a capture, an [`EditList`], which is a text in RON. Out: [`Edited`]: the capture without the Gaussians that the
//! edits remove. All others keep their bits. The original stays as it is: an edit is undone by removing its line and
//! applying the list again.
//!
//! ```text
//! [
//!     keep_box(min: (-2, -2, 0), max: (2, 2, 2.5)),
//!     remove_sphere(center: (1.5, 0, 1), radius: 0.5, times: (0.2, 0.3)),
//!     remove_faint_large(opacity_below: 0.1, scale_above: 0.5),
//!     remove_floaters(cameras_below: 3, distance_below: 0.4),
//! ]
//! ```
//!
//! Lengths and places are those of the capture's own space: of the bounds in `gs4d info`, of
//! [`View`](crate::view::View) and of cameras. A capture with an [origin](super::Origin) counts them from there, as all
//! its views are. Times are timestamps of the capture, between the two of its time interval.
//!
//! # The rule of regions
//!
//! A region is asked about the mean of each Gaussian, at one time:
//!
//! 1. A Gaussian lives at the times of the capture's time interval at which its marginal is above the cut-off, and, if
//!    the capture has a filter of windows, which are within its window.
//! 2. Of the times at which it lives, those within `times` count. The nearest to its temporal mean is that at which it
//!    is most opaque: its mean at that time is inside the region, borders included, or outside. An edit with `times`
//!    does not touch a Gaussian that does not live then. Without `times` all times count, and a Gaussian that never
//!    lives is looked at, too, at the time of the interval that is nearest to its temporal mean.
//! 3. It is removed if it is inside a region to remove, or outside a region to keep: as a whole, also from the times
//!    beside `times`.
//!
//! An edit looks at each Gaussian by itself: the order of the edits changes how many each removes, and not what
//! remains.
//!
//! | file | subject |
//! |---|---|
//! | `list` | the edits, and their text |
//! | `apply` | which Gaussians the edits remove |
//! | `seen` | what the training cameras see of each Gaussian |
//! | `error` | why a list cannot be read or applied |

pub(crate) mod apply;
mod error;
pub(crate) mod list;
mod seen;

pub use apply::{Edited, apply};
pub use error::{EditError, EditListError};
pub use list::{Edit, EditList};
pub use seen::Seen;
