//! The sliced form: Gaussians in single precision.
//!
//! In: Gaussians after the slice, or decoded from the packed form, and their color. Out: a [`Sliced`].

use crate::gaussian::{Gaussian, Harmonics};

/// Sliced Gaussians and their color.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sliced {
    /// The Gaussians: activated, capture space.
    pub gaussians: Vec<Gaussian>,
    /// Their color.
    pub harmonics: Harmonics,
}
