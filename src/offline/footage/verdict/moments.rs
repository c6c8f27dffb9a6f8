//! Moments that cameras do not show.
//!
//! In: the moments of the frames of each camera, and which pictures show nothing. Out: findings about covered lenses,
//! footage that begins or ends black, videos that begin late, end early or have gaps, moments that fewer than two
//! cameras have, and pictures that cannot be read.

use super::evidence::{Evidence, Sample, Seen};
use super::finding::{Finding, Severity, Subject};
use std::collections::HashSet;

/// Share of the moments whose absence, or blackness, is grave.
const GRAVE: f32 = 0.25;
/// Fewest frames of a camera with a usual number of frames: fewer are not a video.
const VIDEO: usize = 3;

/// Returns the findings about moments.
pub(super) fn moments(evidence: &Evidence) -> Vec<Finding> {
    let black = black_for_all(evidence);
    let mut findings = edges(evidence, &black);
    for seen in &evidence.cameras {
        findings.extend(unreadable(seen));
        findings.extend(blank(seen, &black));
        if is_video(evidence) {
            findings.extend(missing(seen, evidence.moments));
        }
    }
    findings.extend(lonely(evidence));
    findings
}

/// Returns whether half of the cameras have several frames.
fn is_video(evidence: &Evidence) -> bool {
    let videos = evidence.cameras.iter().filter(|seen| seen.moments.len() >= VIDEO).count();
    videos > 0 && 2 * videos >= evidence.cameras.len()
}

/// Returns the moments at which all pictures that have been looked at show nothing.
fn black_for_all(evidence: &Evidence) -> HashSet<usize> {
    let all = || evidence.cameras.iter().flat_map(|seen| &seen.samples);
    let shown: HashSet<usize> = all().filter(|sample| !sample.blank).map(|sample| sample.moment).collect();
    all().map(|sample| sample.moment).filter(|moment| !shown.contains(moment)).collect()
}

/// Returns what is to be said about moments at which no camera shows anything.
fn edges(evidence: &Evidence, black: &HashSet<usize>) -> Vec<Finding> {
    let mut looked: Vec<usize> =
        evidence.cameras.iter().flat_map(|seen| &seen.samples).map(|sample| sample.moment).collect();
    looked.sort_unstable();
    looked.dedup();
    if black.is_empty() || looked.iter().all(|moment| black.contains(moment)) {
        return Vec::new();
    }
    let start = looked.iter().take_while(|moment| black.contains(*moment)).count();
    let end = looked.iter().rev().take_while(|moment| black.contains(*moment)).count();
    let middle = black.len().saturating_sub(start + end);
    let remedy = "Cut these moments off all videos.";
    let mut findings = Vec::new();
    if start > 0 {
        let (last, first) = (looked[start - 1], looked[start]);
        let what = format!("All cameras are black at the start: moments 0 to {last}; {first} shows something.");
        findings.push(Finding::new(Severity::Grave, Subject::Blank, what, remedy));
    }
    if end > 0 {
        let first = looked[looked.len() - end];
        let what = format!("All cameras are black at the end: moments {first} to {}.", evidence.moments - 1);
        findings.push(Finding::new(Severity::Grave, Subject::Blank, what, remedy));
    }
    if middle > 0 {
        let what = format!("All cameras are black at {middle} of {} moments looked at, in between.", looked.len());
        findings.push(Finding::new(Severity::Warning, Subject::Blank, what, remedy));
    }
    findings
}

/// Returns what is to be said about a camera that shows nothing where others do.
fn blank(seen: &Seen, black: &HashSet<usize>) -> Option<Finding> {
    let name = seen.name.as_str();
    let own: Vec<&Sample> = seen.samples.iter().filter(|s| s.blank && !black.contains(&s.moment)).collect();
    let usual = seen.samples.iter().filter(|sample| !black.contains(&sample.moment)).count();
    if seen.samples.iter().all(|sample| sample.blank) && !seen.samples.is_empty() {
        let count = seen.samples.len();
        let what = format!("{name} shows nothing in all {count} pictures looked at: was its lens covered?");
        let remedy = "Leave this camera out.";
        return Some(Finding::new(Severity::Grave, Subject::Blank, what, remedy).about([name]));
    }
    let (first, last) = (own.first()?.moment, own.last()?.moment);
    let share = own.len() as f32 / usual.max(1) as f32;
    let severity = if share >= GRAVE { Severity::Grave } else { Severity::Warning };
    let what = format!(
        "{name} shows nothing in {} of {usual} pictures looked at, between moments {first} and {last}: was its lens \
         covered?",
        own.len()
    );
    let remedy = "Leave out these pictures, or this camera.";
    Some(Finding::new(severity, Subject::Blank, what, remedy).about([name]))
}

/// Returns what is to be said about a camera that has no frames at some moments.
fn missing(seen: &Seen, moments: usize) -> Option<Finding> {
    let name = seen.name.as_str();
    let (first, last) = (*seen.moments.first()?, *seen.moments.last()?);
    let distinct = seen.moments.iter().collect::<HashSet<_>>().len();
    let (late, early) = (first, moments.saturating_sub(last + 1));
    let within = (last + 1 - first).saturating_sub(distinct);
    let absent = late + early + within;
    // A single frame is usual: videos that start together seldom have exactly as many.
    if absent < 2 {
        return None;
    }
    let mut parts = Vec::new();
    if early > 1 {
        parts.push(format!("ends early, after moment {last} of {}", moments - 1));
    }
    if late > 1 {
        parts.push(format!("begins late, at moment {first}"));
    }
    if within > 0 {
        parts.push("lacks frames within".to_owned());
    } else if parts.is_empty() {
        parts.push("begins a moment late and ends a moment early".to_owned());
    }
    let severity = if absent as f32 >= GRAVE * moments as f32 { Severity::Grave } else { Severity::Warning };
    let what = format!("The video of {name} {}: {absent} of {moments} moments are missing.", parts.join(" and "));
    let remedy = "Cut all videos to the moments that they share, or export this one again with all of its frames.";
    Some(Finding::new(severity, Subject::Moments, what, remedy).about([name]))
}

/// Returns what is to be said about moments that fewer than two cameras have.
fn lonely(evidence: &Evidence) -> Option<Finding> {
    if evidence.cameras.len() < 2 || evidence.moments == 0 {
        return None;
    }
    let mut counts = vec![0_usize; evidence.moments];
    for seen in &evidence.cameras {
        let distinct: HashSet<usize> = seen.moments.iter().copied().collect();
        distinct.into_iter().filter(|&moment| moment < evidence.moments).for_each(|moment| counts[moment] += 1);
    }
    let lonely: Vec<usize> = (0..counts.len()).filter(|&moment| counts[moment] < 2).collect();
    let first = *lonely.first()?;
    let (count, of) = (lonely.len(), counts.len());
    let severity = if 2 * count > of { Severity::Grave } else { Severity::Warning };
    let what = format!("{count} of {of} moments are seen by fewer than two cameras, the first is moment {first}.");
    let remedy = "Cut the videos to the moments that they share; if they were filmed together, check their times.";
    Some(Finding::new(severity, Subject::Moments, what, remedy))
}

/// Returns what is to be said about pictures that cannot be read.
fn unreadable(seen: &Seen) -> Option<Finding> {
    let (count, reason) = seen.unreadable.as_ref()?;
    let name = &seen.name;
    let what = format!("{count} pictures of {name} cannot be read; the first: {reason}");
    let finding = Finding::new(Severity::Grave, Subject::Pictures, what, "Write these pictures again.");
    Some(finding.about([seen.name.as_str()]))
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen, textured};
    use super::*;
    use image::RgbImage;

    /// Returns four cameras with 12 moments each; `is_black` says which pictures show nothing.
    fn take(is_black: impl Fn(usize, usize) -> bool) -> Evidence {
        let picture = |camera, moment| {
            if is_black(camera, moment) { RgbImage::new(160, 120) } else { textured(1.0, 0.0, 1.0) }
        };
        let cameras = (0..4).map(|camera| seen(camera, 4, (0..12).map(|moment| picture(camera, moment)).collect()));
        evidence(cameras.collect())
    }

    #[test]
    fn a_whole_take_has_no_finding() {
        assert_eq!(moments(&take(|_, _| false)), [], "nothing is missing");
    }

    #[test]
    fn a_lens_cap_is_named() {
        let found = moments(&take(|camera, _| camera == 2));
        assert_eq!(found.len(), 1, "one finding: {found:?}");
        assert_eq!((found[0].severity, found[0].cameras.clone()), (Severity::Grave, vec!["cam2".to_owned()]), "cam2");
        let found = moments(&take(|camera, moment| camera == 1 && moment > 9));
        assert!(found[0].what.contains("2 of 12") && found[0].what.contains("10 and 11"), "a part: {}", found[0]);
    }

    #[test]
    fn a_black_start_of_all_cameras_is_one_finding() {
        let found = moments(&take(|_, moment| moment < 5));
        assert_eq!(found.len(), 1, "one finding, not one for each camera: {found:?}");
        assert!(found[0].what.contains("moments 0 to 4"), "the moments: {}", found[0]);
    }

    #[test]
    fn a_video_that_ends_early_is_named() {
        let mut all = take(|_, _| false);
        all.cameras[3].moments.truncate(7);
        let found = moments(&all);
        assert_eq!(found.len(), 1, "one finding: {found:?}");
        assert!(found[0].what.contains("cam3 ends early, after moment 6 of 11: 5 of 12"), "{}", found[0]);
    }

    #[test]
    fn a_video_that_begins_and_ends_within_the_others_is_named() {
        let mut all = take(|_, _| false);
        all.cameras[3].moments.remove(0);
        all.cameras[3].moments.pop();
        let found = moments(&all);
        assert_eq!(found.len(), 1, "one finding: {found:?}");
        assert!(found[0].what.contains("cam3 begins a moment late and ends a moment early: 2 of 12"), "{}", found[0]);
    }

    #[test]
    fn moments_of_one_camera_alone_are_counted() {
        let mut all = take(|_, _| false);
        all.cameras.iter_mut().skip(1).for_each(|seen| seen.moments.truncate(8));
        let found = moments(&all);
        let lonely = found.iter().find(|finding| finding.cameras.is_empty()).expect("there is one");
        assert!(lonely.what.contains("4 of 12 moments"), "moments 8 to 11: {lonely}");
    }
}
