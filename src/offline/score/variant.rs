//! The variants of scores, by name.
//!
//! In: a name. Out: a [`Variant`]. [`Scores`](super::Scores) defines each of them.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A definition of a score. Names are in kebab-case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Contribution to the pixels, `Σ c`.
    Spatial,
    /// The paper's factor for slow changes of opacity, times the factor for volume, at the times of all views.
    Temporal,
    /// The paper's score: `spatial` with both factors.
    Full,
    /// The paper's score, with the first derivative of opacity in place of the second.
    FirstDerivative,
    /// The paper's score, with the temporal variance in place of the factor for change.
    Sigma,
    /// Root of the sum of the squared contributions at each time.
    Norm2,
    /// The largest contribution at any time.
    Peak,
    /// `norm2` with the paper's factors.
    FullNorm2,
    /// `peak` with the paper's factors.
    FullPeak,
    /// `√Σ c²`: the influence on a squared error.
    Energy,
    /// Root of the squared change of all pictures if this Gaussian alone were removed.
    Removal,
    /// Geometric mean of `energy` and `removal`.
    EnergyRemoval,
}

impl Variant {
    /// Every variant.
    pub const ALL: [Self; 12] = [
        Self::Spatial,
        Self::Temporal,
        Self::Full,
        Self::FirstDerivative,
        Self::Sigma,
        Self::Norm2,
        Self::Peak,
        Self::FullNorm2,
        Self::FullPeak,
        Self::Energy,
        Self::Removal,
        Self::EnergyRemoval,
    ];

    /// The variants that an automatic choice tries: three of our own and the paper's.
    pub const AUTO: [Self; 4] = [Self::EnergyRemoval, Self::Energy, Self::Removal, Self::Full];

    /// Returns the name of the variant.
    pub fn name(self) -> &'static str {
        match self {
            Self::Spatial => "spatial",
            Self::Temporal => "temporal",
            Self::Full => "full",
            Self::FirstDerivative => "first-derivative",
            Self::Sigma => "sigma",
            Self::Norm2 => "norm2",
            Self::Peak => "peak",
            Self::FullNorm2 => "full-norm2",
            Self::FullPeak => "full-peak",
            Self::Energy => "energy",
            Self::Removal => "removal",
            Self::EnergyRemoval => "energy-removal",
        }
    }

    /// Returns whether the variant needs the volume of the Gaussians, which only the trained form has.
    pub fn needs_volume(self) -> bool {
        matches!(
            self,
            Self::Temporal | Self::Full | Self::FirstDerivative | Self::Sigma | Self::FullNorm2 | Self::FullPeak
        )
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// An unknown name of a score.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is no score; there are: {}", Variant::ALL.map(Variant::name).join(", "))]
pub struct UnknownVariant {
    /// The name.
    pub name: String,
}

impl FromStr for Variant {
    type Err = UnknownVariant;

    fn from_str(name: &str) -> Result<Self, UnknownVariant> {
        let found = Self::ALL.into_iter().find(|variant| variant.name() == name);
        found.ok_or_else(|| UnknownVariant { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_the_same_everywhere() {
        for variant in Variant::ALL {
            assert_eq!(variant.name().parse::<Variant>(), Ok(variant), "the name is parsed to the same variant");
            let json = serde_json::to_value(variant).expect("a plain name");
            assert_eq!(json, variant.name(), "the variant is stored by its name");
        }
        let message = "best".parse::<Variant>().expect_err("no such score").to_string();
        assert!(message.contains("best") && message.contains("energy-removal"), "{message}");
    }
}
