//! A finding about footage.
//!
//! In: what a check has found. Out: [`Finding`]: how bad it is, what it is about, the cameras, a sentence with figures,
//! and the remedy.

use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// Most names in a sentence.
const NAMED: usize = 4;

/// How bad a finding is, the worst first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Severity {
    /// The capture will be wrong, unless this is mended.
    Grave,
    /// The capture will be worse.
    Warning,
    /// Good to know.
    Note,
}

/// What a finding is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Subject {
    Cameras,
    Baselines,
    Coverage,
    Direction,
    Pictures,
    Blank,
    Moments,
    Calibration,
    Synchrony,
    Zoom,
    Bump,
    Exposure,
    WhiteBalance,
    Blur,
    MotionBlur,
    Shutter,
    Quality,
}

/// A finding.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Finding {
    pub severity: Severity,
    pub subject: Subject,
    /// Names of the cameras that it is about; none, if it is about all.
    pub cameras: Vec<String>,
    /// A sentence with figures.
    pub what: String,
    /// A sentence that says what to do.
    pub remedy: String,
}

impl Finding {
    /// A finding about all cameras.
    pub(super) fn new(severity: Severity, subject: Subject, what: String, remedy: &str) -> Self {
        Self { severity, subject, cameras: Vec::new(), what, remedy: remedy.to_owned() }
    }

    /// The finding, about these cameras.
    pub(super) fn about<'a>(mut self, cameras: impl IntoIterator<Item = &'a str>) -> Self {
        self.cameras = cameras.into_iter().map(str::to_owned).collect();
        self
    }
}

impl Display for Severity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Grave => "grave",
            Self::Warning => "warning",
            Self::Note => "note",
        })
    }
}

impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} {}", self.severity, self.what, self.remedy)
    }
}

/// Returns the names for a sentence, the first four of many.
pub(super) fn listed(names: &[&str]) -> String {
    match names.len().checked_sub(NAMED) {
        None | Some(0) => names.join(", "),
        Some(more) => format!("{} and {more} more", names[..NAMED].join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_names_are_cut() {
        assert_eq!(listed(&["a", "b"]), "a, b", "two");
        assert_eq!(listed(&["a", "b", "c", "d", "e", "f"]), "a, b, c, d and 2 more", "six");
    }

    #[test]
    fn the_worst_come_first() {
        assert!(Severity::Grave < Severity::Warning && Severity::Warning < Severity::Note, "the order of the verdict");
    }
}
