//! The choice of validation views.
//!
//! In: nothing. Out: [`Validation`], the ways in which validation views are found, by name.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The way in which validation views are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Validation {
    /// The first of these that the dataset allows: a file of validation views, whole cameras, blocks of time, none.
    #[default]
    Auto,
    /// The views of the dataset's own split `val`, such as `transforms_val.json`.
    File,
    /// Every view of some of the training cameras.
    Cameras,
    /// Every training view in some contiguous blocks of time.
    Times,
    /// None: there are no validation views to choose on, and every training view is trained on.
    None,
}

impl Validation {
    /// Every value with its name.
    pub const NAMES: [(&str, Self); 5] = [
        ("auto", Self::Auto),
        ("file", Self::File),
        ("cameras", Self::Cameras),
        ("times", Self::Times),
        ("none", Self::None),
    ];
}

impl fmt::Display for Validation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(_, value)| value == self).map_or("", |(name, _)| name);
        f.write_str(name)
    }
}
