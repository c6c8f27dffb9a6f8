//! The verdict on footage: what it cannot give, before hours of training are spent on it.
//!
//! In: [`Evidence`], which has small pictures of a take, masks of what moves, measured synchrony, and the result of a
//! short training. Out: [`Verdict`]: findings with cameras, figures and remedies, the worst first.
//!
//! | file | what is found |
//! |---|---|
//! | `coverage` | too few cameras, too far apart, in one place, looking elsewhere |
//! | `moments` | covered lenses, black starts, videos that end early, missing moments |
//! | `zoom` | cameras that zoom or are moved during the take |
//! | `sync` | cameras that are not synchronized |
//! | `calibration` | cameras whose calibration contradicts the others |
//! | `exposure` | exposure that drifts, cameras that are brighter or of another tint |
//! | `blur` | cameras out of focus, blur of motion |
//! | `shutter` | bands of a rolling shutter under light that flickers |

mod blur;
mod calibration;
mod coverage;
mod evidence;
mod exposure;
mod finding;
mod geometry;
mod moments;
mod plane;
mod registration;
mod sharpness;
mod shutter;
mod silhouettes;
mod sync;
mod zoom;

pub(crate) use evidence::{CameraSync, Evidence, LONGEST, Rehearsal, Synchrony};
pub(crate) use finding::{Finding, Severity};

use finding::Subject;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// PSNR of views held out, dB, from which a capture looks like the footage, is soft, and is hardly usable.
const GOOD: f32 = 29.0;
const SOFT: f32 = 25.0;
const POOR: f32 = 20.0;

/// What is to be said about footage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Verdict {
    /// The worst first.
    pub findings: Vec<Finding>,
}

/// Returns the verdict.
pub(crate) fn verdict(evidence: &Evidence) -> Verdict {
    let mut findings = coverage::coverage(evidence);
    findings.extend(moments::moments(evidence));
    findings.extend(calibration::calibration(evidence));
    findings.extend(sync::sync(evidence));
    findings.extend(zoom::zoom(evidence));
    findings.extend(exposure::exposure(evidence));
    findings.extend(blur::blur(evidence));
    findings.extend(shutter::shutter(evidence));
    findings.extend(evidence.rehearsal.as_ref().map(quality));
    findings.sort_by_key(|finding| finding.severity);
    Verdict { findings }
}

impl Verdict {
    /// Returns whether a capture of this footage will be wrong.
    pub(crate) fn is_grave(&self) -> bool {
        self.findings.iter().any(|finding| finding.severity == Severity::Grave)
    }
}

impl Display for Verdict {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.findings.is_empty() {
            return f.write_str("Nothing speaks against this footage.");
        }
        let lines: Vec<String> = self.findings.iter().map(Finding::to_string).collect();
        f.write_str(&lines.join("\n"))
    }
}

/// Returns what a short training says about the quality to expect.
fn quality(rehearsal: &Rehearsal) -> Finding {
    let Rehearsal { db, views } = *rehearsal;
    let (severity, words, remedy) = if db >= GOOD {
        (Severity::Note, "good", "A full training adds to that.")
    } else if db >= SOFT {
        (Severity::Note, "fair: details will be soft", "A full training adds to that; more cameras help most.")
    } else if db >= POOR {
        (Severity::Warning, "poor", "Mend what this verdict names first, and add cameras.")
    } else {
        (Severity::Grave, "hardly usable", "Mend what this verdict names first: calibration and synchrony above all.")
    };
    let what = format!("A short training reaches {db:.1} dB on {views} views that were held out: {words}.");
    Finding::new(severity, Subject::Quality, what, remedy)
}

#[cfg(test)]
mod tests {
    use super::evidence::tests::{evidence, seen, textured};
    use super::*;

    #[test]
    fn the_worst_comes_first_and_good_footage_has_no_grave_finding() {
        let still = || (0..6).map(|_| textured(1.0, 0.0, 1.0)).collect();
        let mut all = evidence((0..12).map(|index| seen(index, 12, still())).collect());
        all.rehearsal = Some(Rehearsal { db: 31.0, views: 12 });
        let good = verdict(&all);
        assert!(!good.is_grave(), "nothing is wrong: {good}");
        assert!(good.findings.iter().all(|finding| finding.severity == Severity::Note), "notes only: {good}");
        all.cameras[4].samples.iter_mut().for_each(|sample| sample.blank = true);
        all.rehearsal = Some(Rehearsal { db: 22.0, views: 12 });
        let bad = verdict(&all);
        assert!(bad.is_grave() && bad.findings[0].cameras == ["cam4"], "the covered lens first: {bad}");
        assert_eq!(bad.findings[1].severity, Severity::Warning, "then the poor quality: {bad}");
    }

    #[test]
    fn a_verdict_is_written_with_names_of_severities() {
        let all = evidence(vec![seen(0, 1, vec![textured(1.0, 0.0, 1.0)])]);
        let text = serde_json::to_string(&verdict(&all)).expect("it can be written");
        assert!(text.contains("\"severity\":\"grave\"") && text.contains("\"subject\":\"cameras\""), "{text}");
    }
}
