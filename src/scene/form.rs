//! The forms of a scene's Gaussians, each with its color: the one model of how a scene is stored.
//!
//! In: a trainer's parameters, sliced Gaussians or packed records. Out: a [`SceneForm`], or a [`Form`] if it is ready to draw.
//!
//! ```text
//! SceneForm ─┬─ Trained                               raw parameters, whole harmonics
//!            └─ Ready ── Form ─┬─ Sliced              single precision, whole harmonics
//!                              └─ Packed ─┬─ Whole    quantized records, whole harmonics
//!                                         └─ Coded    quantized records, colors by codebook
//! ```
//!
//! What depends on the form is derived from it by an exhaustive `match`, once each: which variant of `project` draws it
//! (`renderer::Storage::of`), and what the header of a package says (`codec::package::StoredForm::of`).

use super::packed::{CodedColors, PackedColors, PackedScene};
use crate::gaussian::{Gaussian, Harmonics, InvalidGaussian, Model, Parameters, SliceSettings};
use glam::Vec3;

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
    /// Quantized: smaller, and drawn as it is.
    Packed(PackedScene),
}

/// Sliced Gaussians and their color.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sliced {
    /// The Gaussians: activated, capture space.
    pub gaussians: Vec<Gaussian>,
    /// Their color.
    pub harmonics: Harmonics,
}

/// How much color a form holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColorDegrees {
    /// Coefficients per Gaussian and channel, whether they are evaluated or not.
    pub coefficients: usize,
    /// Spatial degree evaluated, 0 to 3.
    pub degree: u32,
    /// Time degree evaluated, 0 to 2; counts only with `degree` 3.
    pub degree_t: u32,
}

impl SceneForm {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        match self {
            Self::Trained(trained) => trained.parameters.len(),
            Self::Ready(form) => form.len(),
        }
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The model of the trained form; `None` for the others, which no longer show it.
    pub fn model(&self) -> Option<Model> {
        match self {
            Self::Trained(trained) => Some(trained.parameters.model()),
            Self::Ready(_) => None,
        }
    }

    /// The harmonics; `None` if the colors are coded.
    pub fn harmonics(&self) -> Option<&Harmonics> {
        match self {
            Self::Trained(trained) => Some(&trained.harmonics),
            Self::Ready(form) => form.harmonics(),
        }
    }

    /// As [`harmonics`](Self::harmonics), to be changed.
    pub fn harmonics_mut(&mut self) -> Option<&mut Harmonics> {
        match self {
            Self::Trained(trained) => Some(&mut trained.harmonics),
            Self::Ready(form) => form.harmonics_mut(),
        }
    }

    /// How much color it holds.
    pub fn color_degrees(&self) -> ColorDegrees {
        match self {
            Self::Trained(trained) => ColorDegrees::of_harmonics(&trained.harmonics),
            Self::Ready(form) => form.color_degrees(),
        }
    }

    /// The form that is drawn: slices the Gaussians if they are not yet. Color is moved, not copied.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn.
    pub(super) fn into_ready(self, settings: &SliceSettings) -> Result<Form, InvalidGaussian> {
        let form = match self {
            Self::Trained(Trained { parameters, harmonics }) => {
                Form::Sliced(Sliced { gaussians: parameters.slice(settings)?, harmonics })
            }
            Self::Ready(form) => {
                form.check()?;
                form
            }
        };
        if let Some(harmonics) = form.harmonics()
            && let Some(bad) = harmonics.values.iter().position(|value| !value.is_finite())
        {
            let index = bad / (harmonics.coefficients * 3);
            return Err(InvalidGaussian { index, reason: "a colour coefficient that is not finite" });
        }
        Ok(form)
    }
}

impl Form {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        match self {
            Self::Sliced(sliced) => sliced.gaussians.len(),
            Self::Packed(packed) => packed.len(),
        }
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of Gaussians and colors in memory.
    pub fn size(&self) -> usize {
        match self {
            Self::Sliced(Sliced { gaussians, harmonics }) => {
                size_of_val(gaussians.as_slice()) + size_of_val(harmonics.values.as_slice())
            }
            Self::Packed(packed) => packed.size(),
        }
    }

    /// One Gaussian, decoded if need be; panics beyond the end, as a slice does.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        match self {
            Self::Sliced(sliced) => sliced.gaussians[index],
            Self::Packed(packed) => packed.gaussian(index),
        }
    }

    /// All Gaussians in order.
    pub fn iter(&self) -> impl Iterator<Item = Gaussian> + '_ {
        (0..self.len()).map(|index| self.gaussian(index))
    }

    /// Color of one Gaussian; see [`Harmonics::color`].
    pub fn color(&self, index: usize, direction: Vec3, tau: f32, time_span: f32) -> Vec3 {
        match self {
            Self::Sliced(sliced) => sliced.harmonics.color(index, direction, tau, time_span),
            Self::Packed(packed) => packed.color(index, direction, tau, time_span),
        }
    }

    /// The harmonics; `None` if the colors are coded.
    pub fn harmonics(&self) -> Option<&Harmonics> {
        match self {
            Self::Sliced(Sliced { harmonics, .. })
            | Self::Packed(PackedScene { colors: PackedColors::Whole(harmonics), .. }) => Some(harmonics),
            Self::Packed(PackedScene { colors: PackedColors::Coded(_), .. }) => None,
        }
    }

    /// As [`harmonics`](Self::harmonics), to be changed.
    pub fn harmonics_mut(&mut self) -> Option<&mut Harmonics> {
        match self {
            Self::Sliced(Sliced { harmonics, .. })
            | Self::Packed(PackedScene { colors: PackedColors::Whole(harmonics), .. }) => Some(harmonics),
            Self::Packed(PackedScene { colors: PackedColors::Coded(_), .. }) => None,
        }
    }

    /// The colors by codebook; `None` if they are whole.
    pub fn coded_colors(&self) -> Option<&CodedColors> {
        match self {
            Self::Packed(PackedScene { colors: PackedColors::Coded(colors), .. }) => Some(colors),
            Self::Sliced(_) | Self::Packed(PackedScene { colors: PackedColors::Whole(_), .. }) => None,
        }
    }

    /// How much color it holds.
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

    /// The Gaussians in single precision and their harmonics; `None` if they are packed.
    pub fn as_sliced(&self) -> Option<&Sliced> {
        match self {
            Self::Sliced(sliced) => Some(sliced),
            Self::Packed(_) => None,
        }
    }

    /// As [`as_sliced`](Self::as_sliced), to be changed.
    pub fn as_sliced_mut(&mut self) -> Option<&mut Sliced> {
        match self {
            Self::Sliced(sliced) => Some(sliced),
            Self::Packed(_) => None,
        }
    }

    /// Whether every Gaussian can be drawn.
    fn check(&self) -> Result<(), InvalidGaussian> {
        match self {
            Self::Sliced(sliced) => {
                sliced.gaussians.iter().enumerate().try_for_each(|(index, gaussian)| {
                    gaussian.check().map_err(|reason| InvalidGaussian { index, reason })
                })
            }
            Self::Packed(packed) => packed.check().map_err(|reason| InvalidGaussian { index: 0, reason }),
        }
    }
}

impl ColorDegrees {
    fn of_harmonics(harmonics: &Harmonics) -> Self {
        Self { coefficients: harmonics.coefficients, degree: harmonics.degree, degree_t: harmonics.degree_t }
    }
}
