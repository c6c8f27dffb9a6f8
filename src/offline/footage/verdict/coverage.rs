//! Where the cameras stand: how many, how far apart, and how much of the scene they see.
//!
//! In: the cameras of a take. Out: findings about their number, the angles between neighbors, the directions around
//! the scene that they cover, and cameras that look elsewhere.

use super::evidence::Evidence;
use super::finding::{Finding, Severity, Subject, listed};
use super::geometry::{Projector, center, place};
use glam::DVec3;

/// Number of cameras from which nothing is said.
const ENOUGH: usize = 4;
/// Angles between neighbors, degrees, from which they are far apart and too far apart.
const FAR: f64 = 45.0;
const TOO_FAR: f64 = 60.0;
/// Largest angle between any two cameras, degrees, below which the rig has nearly one direction.
const NARROW: f64 = 5.0;
/// Extent of the rig as a share of the distance of the scene, below which all cameras stand in one place.
const ONE_PLACE: f64 = 0.01;
/// Directions to test, and the angle from a camera that it covers, degrees.
const DIRECTIONS: usize = 500;
const COVERS: f64 = 30.0;
/// Share of the directions from which nothing is said.
const WELL_COVERED: f64 = 0.5;

/// Returns the findings about the cameras.
pub(super) fn coverage(evidence: &Evidence) -> Vec<Finding> {
    let names = evidence.names();
    let mut findings: Vec<Finding> = number(&names).into_iter().collect();
    if names.len() < 2 {
        return findings;
    }
    let places: Vec<DVec3> = evidence.cameras.iter().map(|seen| place(&seen.camera)).collect();
    let middle = center(evidence.cameras.iter().map(|seen| &seen.camera));
    let mut distances: Vec<f64> = places.iter().map(|place| place.distance(middle)).collect();
    distances.sort_unstable_by(f64::total_cmp);
    let distance = distances[distances.len() / 2];
    let extent = places.iter().map(|place| place.distance(places[0])).fold(0.0, f64::max);
    if extent <= ONE_PLACE * distance || extent <= f64::EPSILON {
        let what = format!("All {} cameras stand in one place: the footage does not tell depth.", names.len());
        let remedy = "Place the cameras around the scene, or check the calibration: translations may be missing.";
        findings.push(Finding::new(Severity::Grave, Subject::Baselines, what, remedy));
        return findings;
    }
    let directions: Vec<DVec3> = places.iter().map(|place| (*place - middle).normalize_or_zero()).collect();
    findings.extend(baselines(&names, &directions));
    findings.extend(around(&directions));
    findings.extend(elsewhere(evidence, middle));
    findings
}

/// Returns what is to be said about the number of cameras.
fn number(names: &[&str]) -> Option<Finding> {
    let finding = match names {
        [] => {
            let what = "No camera has filmed anything.".to_owned();
            Finding::new(Severity::Grave, Subject::Cameras, what, "Check that the folder has videos.")
        }
        [only] => {
            let what = format!("Only one camera, {only}, has filmed: what it does not see is invented.");
            let remedy = "Film with four cameras or more, at most 45 degrees apart.";
            Finding::new(Severity::Grave, Subject::Cameras, what, remedy).about([*only])
        }
        few if few.len() < ENOUGH => {
            let count = few.len();
            let what = format!("Only {count} cameras have filmed ({}): few places are seen from three.", listed(few));
            let remedy = "Add cameras between them, or view the capture from near the cameras only.";
            Finding::new(Severity::Warning, Subject::Cameras, what, remedy)
        }
        _ => return None,
    };
    Some(finding)
}

/// Returns what is to be said about the angles between the cameras, as seen from the center.
fn baselines(names: &[&str], directions: &[DVec3]) -> Option<Finding> {
    let angle = |a: usize, b: usize| directions[a].dot(directions[b]).clamp(-1.0, 1.0).acos().to_degrees();
    let others = |a: usize| (0..names.len()).filter(move |&b| b != a).map(move |b| (a, b, angle(a, b)));
    let nearest = |a: usize| others(a).min_by(|a, b| a.2.total_cmp(&b.2));
    let (a, b, widest) = (0..names.len()).filter_map(nearest).max_by(|a, b| a.2.total_cmp(&b.2))?;
    let all = (0..names.len()).flat_map(others).map(|(_, _, angle)| angle).fold(0.0, f64::max);
    if all < NARROW {
        let what = format!("All cameras film from within {all:.1} degrees: depth is vague, and backs are unknown.");
        let remedy = "Place the cameras farther apart, 10 to 45 degrees between neighbors.";
        return Some(Finding::new(Severity::Warning, Subject::Baselines, what, remedy));
    }
    let severity = if widest > TOO_FAR { Severity::Warning } else { Severity::Note };
    (widest > FAR).then(|| {
        let (a, b) = (names[a], names[b]);
        let what = format!("{a} and its nearest neighbor, {b}, are {widest:.0} degrees apart, seen from the scene.");
        let remedy = "Add a camera between them: neighbors should be at most 45 degrees apart.";
        Finding::new(severity, Subject::Baselines, what, remedy).about([a, b])
    })
}

/// Returns what is to be said about the share of the directions around the scene that the cameras cover.
fn around(directions: &[DVec3]) -> Option<Finding> {
    let near = COVERS.to_radians().cos();
    let is_covered = |index: &usize| {
        let height = 1.0 - 2.0 * (*index as f64 + 0.5) / DIRECTIONS as f64;
        let (sin, cos) = (*index as f64 * 2.399_963_229_728_653).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        let direction = DVec3::new(radius * cos, radius * sin, height);
        directions.iter().any(|camera| camera.dot(direction) >= near)
    };
    let share = (0..DIRECTIONS).filter(is_covered).count() as f64 / DIRECTIONS as f64;
    (share < WELL_COVERED).then(|| {
        let percent = 100.0 * share;
        let what =
            format!("{percent:.0} % of the directions around the scene are within {COVERS:.0} degrees of a camera.");
        let remedy = "View the capture from these directions, or add cameras on the sides that are missing.";
        Finding::new(Severity::Note, Subject::Coverage, what, remedy)
    })
}

/// Returns what is to be said about cameras that do not see what most of the others look at.
fn elsewhere(evidence: &Evidence, middle: DVec3) -> Option<Finding> {
    let names = evidence.names();
    let is_away = |index: &usize| Projector::of(&evidence.cameras[*index].camera).pixel(middle.as_vec3()).is_none();
    let away: Vec<&str> = (0..names.len()).filter(is_away).map(|index| names[index]).collect();
    let most = 2 * away.len() > names.len();
    (!away.is_empty()).then(|| {
        let what = if most {
            let (count, of) = (away.len(), names.len());
            format!("{count} of {of} cameras do not see the point that is nearest to the axes of all.")
        } else {
            format!("The middle of the scene, where the others look, is not in the picture of {}.", listed(&away))
        };
        let remedy = "If the camera did look there, its calibration is wrong; otherwise let all look at one place.";
        Finding::new(Severity::Warning, Subject::Direction, what, remedy).about(away)
    })
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen};
    use super::*;

    fn subjects(count: usize, of: usize) -> Vec<(Severity, Subject)> {
        let found = coverage(&evidence((0..count).map(|index| seen(index, of, Vec::new())).collect()));
        found.iter().map(|finding| (finding.severity, finding.subject)).collect()
    }

    #[test]
    fn one_camera_is_grave_and_few_are_a_warning() {
        assert_eq!(subjects(1, 1), [(Severity::Grave, Subject::Cameras)], "one camera");
        assert!(subjects(3, 12).contains(&(Severity::Warning, Subject::Cameras)), "three cameras");
    }

    #[test]
    fn wide_baselines_are_named_and_a_dense_ring_is_not() {
        assert!(subjects(4, 4).contains(&(Severity::Warning, Subject::Baselines)), "nearly 90 degrees apart");
        assert!(!subjects(12, 12).iter().any(|(_, subject)| *subject == Subject::Baselines), "30 degrees apart");
    }

    #[test]
    fn cameras_in_one_place_are_grave() {
        let cameras = (0..4).map(|_| seen(0, 4, Vec::new())).collect();
        let found = coverage(&evidence(cameras));
        assert!(found.iter().any(|finding| finding.subject == Subject::Baselines), "in one place: {found:?}");
        assert_eq!(found[0].severity, Severity::Grave, "no depth");
    }
}
