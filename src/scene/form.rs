//! The forms of a scene's Gaussians, each with its color.
//!
//! In: a trainer's parameters, sliced Gaussians or packed records. Out: a [`SceneForm`], or a [`Form`] if it is ready
//! to draw.
//!
//! ```text
//! SceneForm ─┬─ Trained                               raw parameters, whole harmonics
//!            └─ Ready ── Form ─┬─ Sliced              single precision, whole harmonics
//!                              └─ Packed ─┬─ Whole    quantized records, whole harmonics
//!                                         └─ Coded    quantized records, colors by codebook
//! ```
//!
//! Two values are derived from the form by an exhaustive `match`: the variant of `project` that draws it
//! (`renderer::Storage::of`), and the form in the header of a package (`codec::package::StoredForm::of`).

use super::packed::{CodedColors, ColorCodebooks, PackedColors, PackedScene};
use super::sliced::Sliced;
use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Lifespan, Model, Parameters};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// The Gaussians of a scene and their color.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneForm {
    /// As an optimizer stores them: can be scored, pruned and fine-tuned.
    Trained(Trained),
    /// Ready to draw.
    Ready(Form),
}

/// Gaussians as an optimizer stores them, and their color.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trained {
    /// The Gaussians: raw, capture space.
    pub parameters: Parameters,
    /// Their color.
    pub harmonics: Harmonics,
}

/// Gaussians that are ready to draw, and their color.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// In single precision.
    Sliced(Sliced),
    /// Quantized: smaller, and drawn without unpacking.
    Packed(PackedScene),
}

/// Number of coefficients and degrees of the color of a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColorDegrees {
    /// Coefficients per Gaussian and channel, whether they are evaluated or not.
    pub coefficients: usize,
    /// Spatial degree evaluated, 0 to 3.
    pub degree: u32,
    /// Time degree evaluated, 0 to 2; used only if `degree` is 3.
    pub degree_t: u32,
}

impl SceneForm {
    /// Returns the means of the Gaussians, capture space.
    pub fn means(&self) -> Vec<[f32; 3]> {
        match self {
            Self::Trained(trained) => trained.parameters.mean.clone(),
            Self::Ready(form) => form.iter().map(|gaussian| gaussian.mean).collect(),
        }
    }

    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        match self {
            Self::Trained(trained) => trained.parameters.len(),
            Self::Ready(form) => form.len(),
        }
    }

    /// Returns whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the model of the trained form; `None` for the other forms, which do not contain it.
    pub fn model(&self) -> Option<Model> {
        match self {
            Self::Trained(trained) => Some(trained.parameters.model()),
            Self::Ready(_) => None,
        }
    }

    /// Returns the harmonics; `None` if the colors are coded.
    pub fn harmonics(&self) -> Option<&Harmonics> {
        match self {
            Self::Trained(trained) => Some(&trained.harmonics),
            Self::Ready(form) => form.harmonics(),
        }
    }

    /// Returns the harmonics, mutable; `None` if the colors are coded.
    pub fn harmonics_mut(&mut self) -> Option<&mut Harmonics> {
        match self {
            Self::Trained(trained) => Some(&mut trained.harmonics),
            Self::Ready(form) => form.harmonics_mut(),
        }
    }

    /// Returns the number of coefficients and the degrees of its color.
    pub fn color_degrees(&self) -> ColorDegrees {
        match self {
            Self::Trained(trained) => ColorDegrees::of_harmonics(&trained.harmonics),
            Self::Ready(form) => form.color_degrees(),
        }
    }

    /// Lowers the degrees of its color to at most the degrees given and removes the coefficients that are no longer
    /// evaluated.
    pub fn truncate_colors(&mut self, degree: u32, degree_t: u32) {
        match self {
            Self::Trained(Trained { harmonics, .. })
            | Self::Ready(Form::Sliced(Sliced { harmonics, .. }))
            | Self::Ready(Form::Packed(PackedScene { colors: PackedColors::Whole(harmonics), .. })) => {
                harmonics.truncate(degree, degree_t);
            }
            Self::Ready(Form::Packed(PackedScene { colors: PackedColors::Coded(colors), .. })) => {
                colors.truncate(degree, degree_t);
            }
        }
    }

    /// Returns the codebooks of its colors; `None` if they are not coded.
    pub fn codebooks(&self) -> Option<&Arc<ColorCodebooks>> {
        match self {
            Self::Trained(_) => None,
            Self::Ready(form) => form.coded_colors().map(|colors| &colors.codebooks),
        }
    }

    /// Checks that its parts fit together.
    pub(super) fn check_parts(&self) -> Result<(), &'static str> {
        match self {
            Self::Trained(trained) => check_colors(&trained.harmonics, trained.parameters.len()),
            Self::Ready(form) => form.check_parts(),
        }
    }
}

impl Form {
    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        match self {
            Self::Sliced(sliced) => sliced.gaussians.len(),
            Self::Packed(packed) => packed.len(),
        }
    }

    /// Returns whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the bytes of Gaussians and colors in memory.
    pub fn size(&self) -> usize {
        match self {
            Self::Sliced(Sliced { gaussians, harmonics }) => {
                size_of_val(gaussians.as_slice()) + size_of_val(harmonics.values.as_slice())
            }
            Self::Packed(packed) => packed.size(),
        }
    }

    /// Returns one Gaussian, decoded if it is packed.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        match self {
            Self::Sliced(sliced) => sliced.gaussians[index],
            Self::Packed(packed) => packed.gaussian(index),
        }
    }

    /// Returns the opacity envelope of one Gaussian in time. No other attribute of a packed Gaussian is decoded.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn lifespan(&self, index: usize) -> Lifespan {
        match self {
            Self::Sliced(sliced) => sliced.gaussians[index].lifespan(),
            Self::Packed(packed) => packed.lifespan(index),
        }
    }

    /// Returns all Gaussians in order.
    pub fn iter(&self) -> impl Iterator<Item = Gaussian> + '_ {
        (0..self.len()).map(|index| self.gaussian(index))
    }

    /// Returns the color of one Gaussian; see [`Harmonics::color`].
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn color(&self, index: usize, direction: Vec3, tau: f32, time_span: f32) -> Vec3 {
        match self {
            Self::Sliced(sliced) => sliced.harmonics.color(index, direction, tau, time_span),
            Self::Packed(packed) => packed.color(index, direction, tau, time_span),
        }
    }

    /// Returns the harmonics; `None` if the colors are coded.
    pub fn harmonics(&self) -> Option<&Harmonics> {
        match self {
            Self::Sliced(Sliced { harmonics, .. })
            | Self::Packed(PackedScene { colors: PackedColors::Whole(harmonics), .. }) => Some(harmonics),
            Self::Packed(PackedScene { colors: PackedColors::Coded(_), .. }) => None,
        }
    }

    /// Returns the harmonics, mutable; `None` if the colors are coded.
    pub fn harmonics_mut(&mut self) -> Option<&mut Harmonics> {
        match self {
            Self::Sliced(Sliced { harmonics, .. })
            | Self::Packed(PackedScene { colors: PackedColors::Whole(harmonics), .. }) => Some(harmonics),
            Self::Packed(PackedScene { colors: PackedColors::Coded(_), .. }) => None,
        }
    }

    /// Returns the colors coded by codebooks; `None` if they are whole.
    pub fn coded_colors(&self) -> Option<&CodedColors> {
        match self {
            Self::Packed(PackedScene { colors: PackedColors::Coded(colors), .. }) => Some(colors),
            Self::Sliced(_) | Self::Packed(PackedScene { colors: PackedColors::Whole(_), .. }) => None,
        }
    }

    /// Returns the number of coefficients and the degrees of its color.
    pub fn color_degrees(&self) -> ColorDegrees {
        match self {
            Self::Sliced(Sliced { harmonics, .. })
            | Self::Packed(PackedScene { colors: PackedColors::Whole(harmonics), .. }) => {
                ColorDegrees::of_harmonics(harmonics)
            }
            Self::Packed(PackedScene { colors: PackedColors::Coded(colors), .. }) => {
                let coefficients = colors.coefficients();
                ColorDegrees { coefficients, degree: colors.degree, degree_t: colors.degree_t }
            }
        }
    }

    /// Returns the Gaussians in single precision and their harmonics; `None` if they are packed.
    pub fn as_sliced(&self) -> Option<&Sliced> {
        match self {
            Self::Sliced(sliced) => Some(sliced),
            Self::Packed(_) => None,
        }
    }

    /// Returns the Gaussians in single precision and their harmonics, mutable; `None` if they are packed.
    pub fn as_sliced_mut(&mut self) -> Option<&mut Sliced> {
        match self {
            Self::Sliced(sliced) => Some(sliced),
            Self::Packed(_) => None,
        }
    }

    /// Returns the packed Gaussians and their color; `None` if they are in single precision.
    pub fn as_packed(&self) -> Option<&PackedScene> {
        match self {
            Self::Packed(packed) => Some(packed),
            Self::Sliced(_) => None,
        }
    }

    /// Checks that its parts fit together.
    pub(super) fn check_parts(&self) -> Result<(), &'static str> {
        match self {
            Self::Sliced(sliced) => check_colors(&sliced.harmonics, sliced.gaussians.len()),
            Self::Packed(packed) => packed.check(),
        }
    }

    /// Checks that each of some Gaussians can be drawn. The parts must fit together.
    pub(super) fn check_some(&self, range: Range<usize>) -> Result<(), InvalidGaussian> {
        let reason = |index: usize| self.gaussian(index).check().err();
        let invalid = |index| Some(InvalidGaussian { index, reason: reason(index)? });
        range.into_par_iter().find_map_first(invalid).map_or(Ok(()), Err)
    }
}

fn check_colors(harmonics: &Harmonics, count: usize) -> Result<(), &'static str> {
    if harmonics.is_consistent(count) { Ok(()) } else { Err("its colors are those of another number of Gaussians") }
}

impl ColorDegrees {
    fn of_harmonics(harmonics: &Harmonics) -> Self {
        Self { coefficients: harmonics.coefficients, degree: harmonics.degree, degree_t: harmonics.degree_t }
    }
}
