//! Cameras whose calibration is wrong.
//!
//! In: masks of what moves, of several moments. Out: a finding about the camera whose silhouettes contradict those of
//! the others: the one without which the others agree, or, of many, the one whose mask the hull of the others does
//! not explain. Two cameras whose videos are exchanged are found by exchanging their masks. A turn around the axis of a
//! camera, with what moves in the middle of its picture, is not found.

use super::evidence::{Evidence, Sample, spread};
use super::finding::{Finding, Severity, Subject, listed};
use super::geometry::{center, place};
use super::plane::median;
use super::silhouettes::{Carved, Silhouette};
use crate::offline::dataset::mask::INSIDE;
use glam::Vec3;
use std::collections::BTreeSet;

/// Fewest cameras of a check.
const FEWEST: usize = 4;
/// Most cameras that are left out one by one: of more, one hardly changes the hull.
const FEW: usize = 8;
/// Moments that are looked at.
const MOMENTS: usize = 5;
/// Share of a picture that usable masks cover.
const COVERS: [f32; 2] = [0.002, 0.6];
/// Gain in agreement without a camera that is found, and that is grave, times the square of the number of cameras. Of
/// four right cameras with rough masks it is 2.9, of seven 0.5; an error of 3 degrees makes it 4.8 and more.
const GAIN: f32 = 4.0;
const GRAVE_GAIN: f32 = 4.5;
/// Agreement of the others that tells that masks are exact, and agreement with the wrong camera that is then found, and
/// is grave: 3 degrees leave 0.94, 5 degrees 0.84.
const EXACT: f32 = 0.985;
const OFF: f32 = 0.95;
const GRAVE_OFF: f32 = 0.88;
/// Agreement of the others without the wrong camera.
const AGREES: f32 = 0.75;
/// Agreement below which something is wrong in any case.
const DISAGREES: f32 = 0.5;
/// Agreement without another camera that is as good.
const AS_GOOD: f32 = 0.05;
/// Agreement below which exchanges are tried, the gain that tells of one, and the agreement after it.
const TRIED: f32 = 0.85;
const EXCHANGED: [f32; 2] = [0.15, 0.65];
/// Share of the usual recall below which a camera is doubtful, and wrong.
const DOUBTFUL: f32 = 0.8;
const WRONG: f32 = 0.6;
const REMEDY: &str = "Calibrate it again, check that its video is the right one, of the same moments, or leave it out.";

/// Returns the finding about calibration.
pub(super) fn calibration(evidence: &Evidence) -> Option<Finding> {
    let (cameras, moments) = usable(evidence);
    if cameras.len() < FEWEST || moments.is_empty() {
        let what = "The calibration was not checked: it needs masks of what moves in four cameras or more.".to_owned();
        let remedy = "Compare a short training with the footage.";
        return (evidence.cameras.len() > 1).then(|| Finding::new(Severity::Note, Subject::Calibration, what, remedy));
    }
    let names: Vec<&str> = cameras.iter().map(|&camera| evidence.cameras[camera].name.as_str()).collect();
    let mut silhouettes: Vec<Vec<Silhouette>> = Vec::new();
    for moment in moments {
        silhouettes.push(cameras.iter().filter_map(|&camera| silhouette(evidence, camera, moment)).collect());
    }
    silhouettes.retain(|all| all.len() == names.len());
    let hulls = Hulls::of(evidence, &silhouettes);
    if names.len() > FEW { many(&names, &hulls) } else { few(&names, &hulls) }
}

/// The silhouettes of several moments, and the cube that their hulls are in.
struct Hulls<'a> {
    moments: &'a [Vec<Silhouette>],
    center: Vec3,
    reach: f32,
}

impl<'a> Hulls<'a> {
    fn of(evidence: &Evidence, moments: &'a [Vec<Silhouette>]) -> Self {
        let middle = center(evidence.cameras.iter().map(|seen| &seen.camera));
        let distances = evidence.cameras.iter().map(|seen| place(&seen.camera).distance(middle) as f32).collect();
        Self { moments, center: middle.as_vec3(), reach: median(distances).unwrap_or(1.0) }
    }

    /// Returns the medians, over the moments, of several figures of the hull of a moment.
    fn medians(&self, figures: impl Fn(&Carved<'_>) -> Vec<f32>) -> Option<Vec<f32>> {
        let of_moment = |all: &Vec<Silhouette>| Carved::of(all, self.center, self.reach).map(|hull| figures(&hull));
        let all: Vec<Vec<f32>> = self.moments.iter().filter_map(of_moment).collect();
        let count = all.first()?.len();
        (0..count).map(|of| median(all.iter().map(|figures| figures[of]).collect())).collect()
    }
}

/// Returns the cameras with usable masks at most moments, and the moments at which all of these have some.
fn usable(evidence: &Evidence) -> (Vec<usize>, Vec<usize>) {
    let at = |camera: usize| -> BTreeSet<usize> {
        let samples = evidence.cameras[camera].samples.iter();
        samples.filter(|sample| is_usable(sample)).map(|sample| sample.moment).collect()
    };
    let all: Vec<BTreeSet<usize>> = (0..evidence.cameras.len()).map(at).collect();
    let any: BTreeSet<usize> = all.iter().flatten().copied().collect();
    let cameras: Vec<usize> = (0..all.len()).filter(|&camera| 2 * all[camera].len() > any.len()).collect();
    let common = any.into_iter().filter(|moment| cameras.iter().all(|&camera| all[camera].contains(moment)));
    let common: Vec<usize> = common.collect();
    let moments = spread(common.len(), MOMENTS).into_iter().map(|index| common[index]).collect();
    (cameras, moments)
}

/// Returns whether the mask of a picture tells a silhouette.
fn is_usable(sample: &Sample) -> bool {
    sample.mask.as_ref().is_some_and(|mask| {
        let covered = mask.pixels().filter(|pixel| pixel.0[0] >= INSIDE).count() as f32;
        (COVERS[0]..=COVERS[1]).contains(&(covered / mask.pixels().len().max(1) as f32))
    })
}

/// Returns the silhouette of a camera at a moment.
fn silhouette(evidence: &Evidence, camera: usize, moment: usize) -> Option<Silhouette> {
    let seen = &evidence.cameras[camera];
    let sample = seen.samples.iter().find(|sample| sample.moment == moment)?;
    Some(Silhouette::of(&seen.camera, sample.mask.as_ref()?))
}

/// Returns what is to be said about few cameras, which are left out one by one.
fn few(names: &[&str], hulls: &Hulls<'_>) -> Option<Finding> {
    let count = names.len();
    let figures = |hull: &Carved<'_>| -> Vec<f32> {
        (0..=count).map(|camera| hull.agreement((camera < count).then_some(camera))).collect()
    };
    let Some(mut without) = hulls.medians(figures) else {
        return Some(disagree(names, 0.0));
    };
    let together = without.pop()?;
    let best = without.iter().copied().fold(0.0, f32::max);
    let gain = (best - together) * (count * count) as f32;
    if together <= TRIED
        && let Some(pair) = exchanged(names, hulls, together)
    {
        return Some(pair);
    }
    let is_exact = best >= EXACT;
    let is_found = best >= AGREES && (gain >= GAIN || is_exact && together <= OFF);
    let likely: Vec<&str> =
        (0..count).filter(|&camera| without[camera] >= best - AS_GOOD).map(|camera| names[camera]).collect();
    if !is_found || likely.len() > 2 {
        return (together < DISAGREES || is_found).then(|| disagree(names, together));
    }
    let is_grave = gain >= GRAVE_GAIN || is_exact && together <= GRAVE_OFF;
    let severity = if is_grave { Severity::Grave } else { Severity::Warning };
    let (all, others) = (100.0 * together, 100.0 * best);
    let what = format!(
        "The calibration of {} does not fit the other cameras: the silhouettes agree to {all:.0} %, without it to \
         {others:.0} %.",
        likely.join(" or ")
    );
    Some(Finding::new(severity, Subject::Calibration, what, REMEDY).about(likely))
}

/// Returns what is to be said about many cameras, each of which is compared with the hull of the others.
fn many(names: &[&str], hulls: &Hulls<'_>) -> Option<Finding> {
    let recalls =
        |hull: &Carved<'_>| -> Vec<f32> { (0..names.len()).map(|camera| hull.recall(camera, Some(camera))).collect() };
    let Some(recalls) = hulls.medians(recalls) else {
        return Some(disagree(names, 0.0));
    };
    let usual = median(recalls.clone())?;
    if usual < DISAGREES {
        return Some(disagree(names, usual));
    }
    let below = |limit: f32| -> Vec<usize> { (0..names.len()).filter(|&at| recalls[at] < limit * usual).collect() };
    let doubtful = below(DOUBTFUL);
    let least = doubtful.iter().map(|&camera| recalls[camera]).min_by(f32::total_cmp)?;
    let severity = if below(WRONG).is_empty() { Severity::Warning } else { Severity::Grave };
    let doubtful: Vec<&str> = doubtful.into_iter().map(|camera| names[camera]).collect();
    let (own, others) = (100.0 * least, 100.0 * usual);
    let what = format!(
        "The calibration of {} does not fit the other cameras: these explain {own:.0} % of its silhouette, where \
         {others:.0} % is usual.",
        listed(&doubtful)
    );
    Some(Finding::new(severity, Subject::Calibration, what, REMEDY).about(doubtful))
}

/// Returns what is to be said about silhouettes that do not agree, where no camera is to blame.
fn disagree(names: &[&str], agreement: f32) -> Finding {
    let percent = 100.0 * agreement;
    let what = format!("The silhouettes of the {} cameras agree to {percent:.0} % only.", names.len());
    let remedy = "Check calibration, synchrony and the masks: several cameras may be wrong, or the masks may be rough.";
    Finding::new(Severity::Warning, Subject::Calibration, what, remedy)
}

/// Returns what is to be said about two cameras whose exchange lets all agree, better than `together`.
fn exchanged(names: &[&str], hulls: &Hulls<'_>, together: f32) -> Option<Finding> {
    let moments = &hulls.moments[..hulls.moments.len().min(2)];
    let pairs = (0..names.len()).flat_map(|a| (a + 1..names.len()).map(move |b| (a, b)));
    let agreement = |(a, b): (usize, usize)| {
        let mut exchanged = moments.to_vec();
        exchanged.iter_mut().try_for_each(|all| Silhouette::exchange(all, a, b))?;
        let hulls = Hulls { moments: &exchanged, ..*hulls };
        let agreement = hulls.medians(|hull| vec![hull.agreement(None)])?;
        Some((a, b, *agreement.first()?))
    };
    let (a, b, best) = pairs.filter_map(agreement).max_by(|a, b| a.2.total_cmp(&b.2))?;
    (best >= together + EXCHANGED[0] && best >= EXCHANGED[1]).then(|| {
        let (a, b, before, after) = (names[a], names[b], 100.0 * together, 100.0 * best);
        let what = format!(
            "{a} and {b} seem to be exchanged: the silhouettes agree to {before:.0} %, with the two exchanged to \
             {after:.0} %."
        );
        let remedy = "Exchange the names of their videos, or their entries in the calibration.";
        Finding::new(Severity::Grave, Subject::Calibration, what, remedy).about([a, b])
    })
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen, textured};
    use super::super::geometry::Projector;
    use super::*;
    use glam::{Mat4, UVec2};
    use image::imageops::FilterType;
    use image::{GrayImage, Luma};

    /// Returns a ring of cameras that have seen two balls at two moments.
    fn ring(count: usize) -> Evidence {
        let cell = |index: u32, axis: u32| (index / 80_u32.pow(axis) % 80) as f32 / 40.0 - 0.9875;
        let places = (0..80_u32.pow(3)).map(|index| Vec3::new(cell(index, 0), cell(index, 1), cell(index, 2)));
        let balls = [(Vec3::new(0.2, 0.0, -0.3), 0.5), (Vec3::new(-0.4, 0.3, 0.5), 0.3)];
        let is_ball = |place: &Vec3| balls.iter().any(|(middle, radius)| place.distance(*middle) < *radius);
        let places: Vec<Vec3> = places.filter(is_ball).collect();
        let cameras = (0..count).map(|index| {
            let mut seen = seen(index, count, vec![textured(1.0, 0.0, 1.0); 2]);
            let projector = Projector::of(&seen.camera);
            let mut mask = GrayImage::new(seen.camera.size.x, seen.camera.size.y);
            for pixel in places.iter().filter_map(|place| projector.pixel(*place)) {
                mask.put_pixel(pixel as u32 % mask.width(), pixel as u32 / mask.width(), Luma([255]));
            }
            // The places are 1.3 pixels apart.
            let closed = GrayImage::from_fn(mask.width(), mask.height(), |x, y| {
                let (left, above) = (x.saturating_sub(1), y.saturating_sub(1));
                let near = [[x, y], [left, y], [x, above], [left, above]];
                Luma([near.map(|[x, y]| mask.get_pixel(x, y).0[0]).into_iter().max().unwrap_or(0)])
            });
            seen.samples.iter_mut().for_each(|sample| sample.mask = Some(closed.clone()));
            seen
        });
        evidence(cameras.collect())
    }

    #[test]
    fn right_cameras_have_no_finding_and_one_that_is_turned_is_named() {
        let mut all = ring(5);
        assert_eq!(calibration(&all), None, "all are right");
        let turned = Mat4::from_rotation_y(7.0_f32.to_radians()) * all.cameras[1].camera.world_to_camera;
        all.cameras[1].camera.world_to_camera = turned;
        let found = calibration(&all).expect("one is off by seven degrees");
        assert_eq!((found.severity, found.cameras.clone()), (Severity::Grave, vec!["cam1".to_owned()]), "{found}");
    }

    #[test]
    fn exchanged_cameras_are_named() {
        let mut all = ring(5);
        let camera = all.cameras[1].camera;
        all.cameras[1].camera = all.cameras[2].camera;
        all.cameras[2].camera = camera;
        let found = calibration(&all).expect("two are exchanged");
        assert_eq!(found.cameras, ["cam1", "cam2"], "{found}");
    }

    #[test]
    fn cameras_with_pictures_of_other_sizes_are_not_exchanged() {
        let mut all = ring(5);
        let seen = &mut all.cameras[4];
        let size = seen.camera.size - UVec2::new(0, seen.camera.size.y / 4);
        // The lens has angles: the same view, with fewer rows.
        seen.camera.size = size;
        let fewer = |mask: &GrayImage| image::imageops::resize(mask, size.x, size.y, FilterType::Nearest);
        seen.samples.iter_mut().for_each(|sample| sample.mask = sample.mask.as_ref().map(fewer));
        let camera = all.cameras[1].camera;
        all.cameras[1].camera = all.cameras[2].camera;
        all.cameras[2].camera = camera;
        let found = calibration(&all).expect("two are exchanged");
        assert_eq!(found.cameras, ["cam1", "cam2"], "and the one with smaller pictures is left: {found}");
    }

    #[test]
    fn without_masks_it_is_said_that_nothing_was_checked() {
        let all = evidence((0..4).map(|index| seen(index, 4, vec![textured(1.0, 0.0, 1.0)])).collect());
        let found = calibration(&all).expect("it is said");
        assert_eq!(found.severity, Severity::Note, "a note: {found}");
    }
}
