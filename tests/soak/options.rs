//! The command line.
//!
//! In: the arguments of the process, including arguments for the default test harness. Out: [`Options`].

use crate::support::harness::own_arguments;
use clap::Parser;
use std::path::PathBuf;
use std::time::Duration;

/// Numbers of changes and cuts without options, as in a plain `cargo test`.
const STEPS: u64 = 100;
const CUTS: u64 = 40;

/// Changes a Bevy app with captures at random, and checks its pictures, its log and its memory.
#[derive(Parser)]
#[command(name = "soak")]
pub struct Options {
    /// Seed of all changes and cuts.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Change an app for this number of minutes.
    #[arg(long, value_name = "M", conflicts_with = "steps")]
    minutes: Option<u64>,
    /// Number of changes.
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Begin with the state after this number of changes: a defect may need only the last changes.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub from: u64,
    /// Folder for pictures that differ from those of a new app, and for the pictures of the new app.
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
    /// Number of cuts, in another app.
    #[arg(long, value_name = "N")]
    cuts: Option<u64>,
    /// Draw the state after this number of changes into a folder. Each check starts the program with this option.
    #[arg(long, value_name = "N", hide = true, requires = "pictures")]
    fresh: Option<u64>,
    /// The numbers of the captures, in the order in which they are drawn.
    #[arg(long, value_name = "N,..", hide = true, value_delimiter = ',')]
    order: Vec<u64>,
    /// Folder for the pictures of `fresh`.
    #[arg(long, value_name = "DIR", hide = true)]
    pictures: Option<PathBuf>,
    /// Parts of the names of tests to run.
    #[arg(hide = true)]
    filters: Vec<String>,
}

/// The pictures that a new app draws for a check.
pub struct Fresh {
    /// Number of changes.
    pub step: u64,
    /// The numbers of the captures, in the order in which they are drawn.
    pub order: Vec<u64>,
    /// Folder for the pictures.
    pub folder: PathBuf,
}

/// The end of the changes.
#[derive(Clone, Copy)]
pub struct Until {
    pub steps: u64,
    pub time: Duration,
}

impl Options {
    /// Returns the options that the process was started with.
    pub fn of_command_line() -> Self {
        Self::parse_from(own_arguments())
    }

    /// Returns the pictures to draw for a check; `None` if this process was not started by a check.
    pub fn fresh(&self) -> Option<Fresh> {
        let (order, folder) = (self.order.clone(), self.pictures.clone()?);
        self.fresh.map(|step| Fresh { step, order, folder })
    }

    /// Returns the end of the changes; `None` if no changes are to be made.
    pub fn changes(&self) -> Option<Until> {
        let until = match (self.minutes, self.steps, self.cuts) {
            (Some(minutes), ..) => Until { steps: u64::MAX, time: Duration::from_secs(minutes.saturating_mul(60)) },
            (None, Some(steps), _) => Until { steps, time: Duration::MAX },
            (None, None, Some(_)) => return None,
            (None, None, None) => Until { steps: STEPS, time: Duration::MAX },
        };
        self.wants("soak::changes").then_some(until)
    }

    /// Returns the number of cuts; `None` if no cuts are to be made.
    pub fn cuts(&self) -> Option<u64> {
        let plain = self.minutes.is_none() && self.steps.is_none();
        self.cuts.or(plain.then_some(CUTS)).filter(|_| self.wants("soak::cuts"))
    }

    fn wants(&self, name: &str) -> bool {
        self.filters.is_empty() || self.filters.iter().any(|filter| name.contains(filter))
    }
}
