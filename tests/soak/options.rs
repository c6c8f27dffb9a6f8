//! The command line.
//!
//! In: the arguments of the process, among them those that are meant for the usual test harness. Out: [`Options`].

use clap::Parser;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

/// Changes and cuts unless the command line asks for some: those of a plain `cargo test`.
const STEPS: u64 = 100;
const CUTS: u64 = 40;

/// Arguments of the usual test harness, which `cargo test -- ARGUMENTS` hands to every test binary.
const FOREIGN: [&str; 6] = ["--nocapture", "--no-capture", "--show-output", "--quiet", "-q", "--exact"];

/// Changes a Bevy app with captures at random, and watches what it draws and what it holds.
#[derive(Parser)]
#[command(name = "soak")]
pub struct Options {
    /// Seed of all changes and cuts.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Change an app for this time.
    #[arg(long, value_name = "M", conflicts_with = "steps")]
    minutes: Option<u64>,
    /// Change an app so often.
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Begin with what is shown after so many changes: a defect may need fewer than led to it.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub from: u64,
    /// Folder for the pictures that are not those of a new app, beside those.
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
    /// Cut so often, in another app.
    #[arg(long, value_name = "N")]
    cuts: Option<u64>,
    /// Draw what an app should show after so many changes into a folder: a check starts this.
    #[arg(long, value_name = "N", hide = true, requires = "pictures")]
    fresh: Option<u64>,
    /// The captures by number, in the order in which they are drawn.
    #[arg(long, value_name = "N,..", hide = true, value_delimiter = ',')]
    order: Vec<u64>,
    /// The folder.
    #[arg(long, value_name = "DIR", hide = true)]
    pictures: Option<PathBuf>,
    /// Parts of the names of tests.
    #[arg(hide = true)]
    filters: Vec<String>,
}

/// What a new app is to draw for a check.
pub struct Fresh {
    /// Number of changes.
    pub step: u64,
    /// The captures by number, in the order in which they are drawn.
    pub order: Vec<u64>,
    /// Where to write the pictures.
    pub folder: PathBuf,
}

/// When the changes end.
#[derive(Clone, Copy)]
pub struct Until {
    pub steps: u64,
    pub time: Duration,
}

impl Options {
    /// Returns the options that the process was started with.
    pub fn of_command_line() -> Self {
        let foreign = |argument: &OsString| {
            let text = argument.to_string_lossy();
            FOREIGN.contains(&&*text) || text.starts_with("--test-threads=")
        };
        Self::parse_from(std::env::args_os().filter(|argument| !foreign(argument)))
    }

    /// Returns what is to be drawn for a check; `None` if this process is not one.
    pub fn fresh(&self) -> Option<Fresh> {
        let (order, folder) = (self.order.clone(), self.pictures.clone()?);
        self.fresh.map(|step| Fresh { step, order, folder })
    }

    /// Returns when the changes end; `None` if none are wanted.
    pub fn changes(&self) -> Option<Until> {
        let until = match (self.minutes, self.steps, self.cuts) {
            (Some(minutes), ..) => Until { steps: u64::MAX, time: Duration::from_secs(minutes.saturating_mul(60)) },
            (None, Some(steps), _) => Until { steps, time: Duration::MAX },
            (None, None, Some(_)) => return None,
            (None, None, None) => Until { steps: STEPS, time: Duration::MAX },
        };
        self.wants("soak::changes").then_some(until)
    }

    /// Returns the number of cuts; `None` if none are wanted.
    pub fn cuts(&self) -> Option<u64> {
        let plain = self.minutes.is_none() && self.steps.is_none();
        self.cuts.or(plain.then_some(CUTS)).filter(|_| self.wants("soak::cuts"))
    }

    fn wants(&self, name: &str) -> bool {
        self.filters.is_empty() || self.filters.iter().any(|filter| name.contains(filter))
    }
}
