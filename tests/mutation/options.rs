//! The command line.
//!
//! In: the arguments of the process, including those of the usual test harness. Out: [`Options`].

use crate::support::harness::own_arguments;
use clap::Parser;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Inputs of each reader unless the command line says otherwise: those of a plain `cargo test`.
const INPUTS: u64 = 60;

/// Runs every reader on changed files and checks the outcomes.
#[derive(Parser)]
#[command(name = "mutation")]
pub struct Options {
    /// Seed of all inputs.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Number of inputs of each reader [default: 60; with --seconds, as many as the time allows].
    #[arg(long, value_name = "N")]
    inputs: Option<u64>,
    /// End after this time.
    #[arg(long, value_name = "S")]
    seconds: Option<u64>,
    /// Only this reader; can be given several times.
    #[arg(long, value_name = "NAME")]
    reader: Vec<String>,
    /// Only the input with this number, of the one reader given.
    #[arg(long, value_name = "N", requires = "reader")]
    pub input: Option<u64>,
    /// Only this file, as an input of the one reader given.
    #[arg(long, value_name = "FILE", requires = "reader", conflicts_with = "input")]
    pub file: Option<PathBuf>,
    /// Folder for the inputs that show a defect, and for the current input in case that it ends the process.
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
    /// Also draw accepted scenes with both GPU designs, and compare the pictures with those of the CPU reference.
    #[arg(long)]
    pub draw: bool,
    /// List the readers.
    #[arg(long)]
    pub list: bool,
    /// Parts of the names of tests.
    #[arg(hide = true)]
    filters: Vec<String>,
}

impl Options {
    /// Returns the options that the process was started with.
    pub fn of_command_line() -> Self {
        Self::parse_from(own_arguments())
    }

    /// Returns whether a reader is wanted.
    pub fn want(&self, reader: &str) -> bool {
        let name = format!("mutation::{reader}");
        let filtered = self.filters.is_empty() || self.filters.iter().any(|filter| name.contains(filter));
        filtered && (self.reader.is_empty() || self.reader.iter().any(|wanted| wanted == reader))
    }

    /// Returns the name of a requested reader that is not among `known`.
    pub fn unknown_reader(&self, known: &[&str]) -> Option<&str> {
        self.reader.iter().map(String::as_str).find(|wanted| !known.contains(wanted))
    }

    /// Returns whether the inputs with this number are left out, in a run that began at `start`.
    pub fn is_over(&self, number: u64, start: Instant) -> bool {
        let inputs = self.inputs.unwrap_or(if self.seconds.is_some() { u64::MAX } else { INPUTS });
        let time = self.seconds.map_or(Duration::MAX, Duration::from_secs);
        number >= inputs || start.elapsed() >= time
    }
}
