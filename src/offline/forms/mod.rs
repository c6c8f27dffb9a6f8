//! The forms of a scene, and the files of other programs.
//!
//! In: a scene in any form. Out: the same scene in another form, as the work needs it: the form that is drawn
//! ([`Subject`]), a form that a package stores ([`convert`]), files that other programs open (`export`).

pub(crate) mod convert;
mod error;
pub(crate) mod export;
pub(crate) mod subject;

pub use convert::{ConvertSettings, TargetForm, convert};
pub use error::FormError;
pub use subject::Subject;
