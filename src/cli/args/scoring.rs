//! The score, and the views that it is computed from.
//!
//! In: the name of a score, the options for scoring. Out: a [`ScoreChoice`], [`ScoringSettings`].

use super::effects::Need;
use super::{Given, values};
use crate::cli::output::failure::Failure;
use crate::offline::prune::ScoreChoice;
use crate::offline::score::{ScoreSettings, ScoringSettings, Variant};
use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Returns a parser for `auto`, `all` (if `with_all`) or the name of a score.
pub(crate) fn score_choice(with_all: bool) -> impl TypedValueParser<Value = ScoreChoice> {
    let special: &[&str] = if with_all { &["auto", "all"] } else { &["auto"] };
    let names = special.iter().copied().chain(Variant::ALL.map(Variant::name));
    PossibleValuesParser::new(names).map(|name: String| match name.as_str() {
        "all" => ScoreChoice::All,
        name => name.parse().map_or(ScoreChoice::Auto, ScoreChoice::One),
    })
}

/// From which views scores are computed, and how.
#[derive(clap::Args)]
#[command(next_help_heading = "Scoring")]
pub(crate) struct ScoringArgs {
    /// Score with an even subset of N views [default: all].
    #[arg(long, value_name = "N", value_parser = values::count(10_000_000))]
    views: Option<usize>,
    /// Power of the volume in the paper's factor; 0 leaves the volume out.
    #[arg(long, value_name = "P", default_value = "0.1", value_parser = values::not_negative)]
    volume_power: f64,
    /// Share of the volumes, from the largest down, at which the paper's reference volume lies.
    #[arg(long, value_name = "R", default_value = "0.9", value_parser = values::share)]
    volume_rank: f64,
}

impl ScoringArgs {
    /// Checks that the options of the volume are given only if one of these scores depends on it.
    ///
    /// # Errors
    /// An option that has no effect.
    pub(crate) fn check(&self, given: &Given, choices: &[ScoreChoice]) -> Result<(), Failure> {
        let mut variants = choices.iter().flat_map(|choice| choice.variants(true));
        given.require(Need::VolumeScore, variants.any(Variant::needs_volume))?;
        given.require(Need::VolumeWeight, self.volume_power != 0.0)
    }

    /// Returns the settings of the library.
    pub(crate) fn settings(&self) -> ScoringSettings {
        let score = ScoreSettings { volume_power: self.volume_power, volume_rank: self.volume_rank };
        ScoringSettings { views: self.views, score }
    }
}
