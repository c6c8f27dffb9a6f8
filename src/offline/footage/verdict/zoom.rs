//! Cameras that zoom or are moved during the take.
//!
//! In: small pictures of each camera. Out: findings about cameras whose background is scaled, shifted or turned
//! relative to their first picture.

use super::evidence::{Evidence, LONGEST, Sample, Seen, spread};
use super::finding::{Finding, Severity, Subject};
use super::registration::{Motion, Registered, registered};
use rayon::prelude::*;

/// Later pictures that are compared with the first.
const COMPARED: usize = 6;
/// Change of scale that is found, and that is grave. A standing camera has 0.0002.
const GROWTH: f32 = 0.005;
const GRAVE_GROWTH: f32 = 0.02;
/// Movement that is found, and that is grave, pixels of a picture of 320. A standing camera has 0.02.
const SHIFT: f32 = 0.5;
const GRAVE_SHIFT: f32 = 1.5;
const REMEDY: &str = "Cut the take where it begins, or leave this camera out; fix focal length, focus and tripod.";

/// Returns the findings about cameras that do not stand still.
pub(super) fn zoom(evidence: &Evidence) -> Vec<Finding> {
    evidence.cameras.par_iter().filter_map(of_camera).collect()
}

/// Returns what is to be said about a camera.
fn of_camera(seen: &Seen) -> Option<Finding> {
    let samples: Vec<&Sample> = seen.shown().collect();
    let (first, later) = samples.split_first()?;
    let chosen = spread(later.len(), COMPARED).into_iter().map(|index| later[index]);
    let compared: Vec<(usize, Registered)> = chosen.map(|sample| (sample.moment, registered(first, sample))).collect();
    let half = first.gray.size.max_element() as f32 / 2.0;
    let scale = LONGEST as f32 / first.gray.size.max_element().max(1) as f32;
    let moved = |motion: &Motion| motion.shift.length().max(motion.turn.abs() * half) * scale;
    let motions = compared.iter().filter_map(|&(moment, found)| Some((moment, found.motion()?)));
    let motions: Vec<(usize, Motion)> = motions.collect();
    let zoomed = motions.iter().max_by(|a, b| a.1.growth.abs().total_cmp(&b.1.growth.abs()));
    let bumped = motions.iter().max_by(|a, b| moved(&a.1).total_cmp(&moved(&b.1)));
    let name = seen.name.as_str();
    let since = |is_off: &dyn Fn(&Motion) -> bool| motions.iter().find(|(_, m)| is_off(m)).map_or(0, |(at, _)| *at);
    if let Some((_, worst)) = zoomed.filter(|(_, worst)| worst.growth.abs() >= GROWTH) {
        let severity = if worst.growth.abs() >= GRAVE_GROWTH { Severity::Grave } else { Severity::Warning };
        let (factor, from) = (1.0 + worst.growth, since(&|motion| motion.growth.abs() >= GROWTH));
        let what = format!("{name} zooms during the take: its background grows {factor:.3}-fold from moment {from}.");
        return Some(Finding::new(severity, Subject::Zoom, what, REMEDY).about([name]));
    }
    if let Some((_, worst)) = bumped.filter(|(_, worst)| moved(worst) >= SHIFT) {
        let severity = if moved(worst) >= GRAVE_SHIFT { Severity::Grave } else { Severity::Warning };
        let (pixels, from) = (moved(worst), since(&|motion| moved(motion) >= SHIFT));
        let what = format!(
            "{name} was moved during the take: its background is off by {pixels:.1} pixels of a picture of {LONGEST}, \
             from moment {from} on."
        );
        return Some(Finding::new(severity, Subject::Bump, what, REMEDY).about([name]));
    }
    let lost: Vec<usize> =
        compared.iter().filter(|(_, found)| *found == Registered::Lost).map(|(moment, _)| *moment).collect();
    let from = *lost.first()?;
    (2 * lost.len() >= compared.len()).then(|| {
        let what = format!("The background of {name} is not the same as at its first picture, from moment {from} on.");
        let remedy = "Look at its video: a camera that is carried or turned cannot be used as one that stands.";
        Finding::new(Severity::Warning, Subject::Bump, what, remedy).about([name])
    })
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen, textured};
    use super::*;

    fn found(scale: impl Fn(usize) -> f32, shift: impl Fn(usize) -> f32) -> Vec<Finding> {
        let moving = (0..8).map(|moment| textured(scale(moment), shift(moment), 1.0)).collect();
        let still = (0..8).map(|_| textured(1.0, 0.0, 1.0)).collect();
        zoom(&evidence(vec![seen(0, 2, still), seen(1, 2, moving)]))
    }

    #[test]
    fn a_zoom_during_the_take_is_grave() {
        let found = found(|moment| 1.0 + 0.06 * moment as f32 / 7.0, |_| 0.0);
        assert_eq!(found.len(), 1, "one camera: {found:?}");
        assert_eq!((found[0].severity, found[0].subject), (Severity::Grave, Subject::Zoom), "{found:?}");
        assert_eq!(found[0].cameras, ["cam1"], "the second");
    }

    #[test]
    fn a_bump_is_named_with_its_moment() {
        let found = found(|_| 1.0, |moment| if moment > 4 { 2.0 } else { 0.0 });
        assert_eq!(found.len(), 1, "one camera: {found:?}");
        assert_eq!((found[0].severity, found[0].subject), (Severity::Grave, Subject::Bump), "{found:?}");
        assert!(found[0].what.contains("off by 4.0 pixels") && found[0].what.contains("from moment 5"), "{}", found[0]);
    }
}
