//! Exposure and white balance.
//!
//! In: small pictures of each camera. Out: findings about cameras whose exposure changes during the take, and about
//! cameras that are brighter, darker or of another tint than the others.

use super::evidence::{Evidence, Sample, Seen};
use super::finding::{Finding, Severity, Subject};
use super::plane::median;

/// Quotient of the greatest and the least gain of a camera, from which its exposure drifts, and is lost.
const DRIFTS: f32 = 1.04;
const LOST: f32 = 1.3;
/// Quotient of the brightness of a camera and of the usual one. Cameras that see other things differ by 1.7.
const DIFFERS: f32 = 2.0;
/// Quotient of red or blue to green, relative to the usual one. Cameras that see other things differ by 1.06.
const TINTED: f32 = 1.14;
/// Luminance, 0 to 255, of pixels that tell a gain.
const USABLE: [f32; 2] = [12.0, 240.0];
/// Least luminance of a pixel that shows something: where pictures leave out the background they are black.
const SHOWN: f32 = 2.0;
/// Fewest pixels that tell a gain, or a brightness.
const FEWEST: usize = 200;
const REMEDY: &str = "Lock the exposure of the cameras; `--exposure=on` trains a color for each camera, and is the \
                      default for several cameras that stand still.";

/// Returns the findings about exposure and white balance.
pub(super) fn exposure(evidence: &Evidence) -> Vec<Finding> {
    let mut findings: Vec<Finding> = evidence.cameras.iter().filter_map(drift).collect();
    let looks: Vec<(&str, [f32; 3])> =
        evidence.cameras.iter().filter_map(|seen| Some((seen.name.as_str(), look(seen)?))).collect();
    if looks.len() < 3 {
        return findings;
    }
    let usual = [0, 1, 2].map(|of| median(looks.iter().map(|(_, look)| look[of]).collect()).unwrap_or(1.0));
    for &(name, look) in &looks {
        let [bright, red, blue] = [0, 1, 2].map(|of| look[of] / usual[of].max(1e-3));
        if apart(bright) > DIFFERS {
            let what = format!("{name} is {bright:.2} times as bright as the other cameras.");
            findings.push(Finding::new(Severity::Warning, Subject::Exposure, what, REMEDY).about([name]));
        }
        if apart(red).max(apart(blue)) > TINTED {
            let what = format!(
                "The white balance of {name} differs from that of the other cameras: red {red:.2}, blue {blue:.2} \
                 times theirs."
            );
            findings.push(Finding::new(Severity::Warning, Subject::WhiteBalance, what, REMEDY).about([name]));
        }
    }
    findings
}

/// Returns a quotient, or its reciprocal if that is greater.
fn apart(quotient: f32) -> f32 {
    quotient.max(quotient.max(1e-6).recip())
}

/// Returns what is to be said about the exposure of a camera during the take.
fn drift(seen: &Seen) -> Option<Finding> {
    let mut shown = seen.shown();
    let first = shown.next()?;
    let gains: Vec<(usize, f32)> =
        shown.filter_map(|sample| Some((sample.moment, gain(first, sample)?))).chain([(first.moment, 1.0)]).collect();
    let least = gains.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let greatest = gains.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let quotient = greatest.1 / least.1.max(1e-3);
    (quotient > DRIFTS).then(|| {
        let name = seen.name.as_str();
        let severity = if quotient > LOST { Severity::Grave } else { Severity::Warning };
        let percent = 100.0 * (quotient - 1.0);
        let what = format!(
            "The exposure of {name} changes by {percent:.0} % during the take: moment {} is its darkest, {} its \
             brightest.",
            least.0, greatest.0
        );
        let remedy = "Lock exposure, gain and white balance of the camera; a change during the take becomes flicker.";
        Finding::new(severity, Subject::Exposure, what, remedy).about([name])
    })
}

/// Returns how much brighter what stands still is in another picture of the camera; `None` if few pixels tell.
fn gain(first: &Sample, other: &Sample) -> Option<f32> {
    let is_usable = |value: f32| (USABLE[0]..=USABLE[1]).contains(&value);
    let width = first.gray.size.x;
    let same = first.gray.size == other.gray.size;
    let pairs = first.gray.values.iter().zip(&other.gray.values).enumerate().filter(|_| same);
    let usable = pairs.filter(|&(index, (&a, &b))| {
        let (x, y) = (index as u32 % width, index as u32 / width);
        is_usable(a) && b > 1.0 && b <= USABLE[1] && first.stands(x, y) && other.stands(x, y)
    });
    let gains: Vec<f32> = usable.map(|(_, (a, b))| b / a).collect();
    if gains.len() < FEWEST { None } else { median(gains) }
}

/// Returns the median luminance of what a camera shows, and its mean red and blue over its mean green; `None` without
/// pictures, or if they are nearly black.
fn look(seen: &Seen) -> Option<[f32; 3]> {
    let sample = seen.shown().next()?;
    let mut sums = [0.0_f64; 3];
    for pixel in sample.color.pixels() {
        sums.iter_mut().zip(pixel.0).for_each(|(sum, value)| *sum += f64::from(value));
    }
    let [red, green, blue] = sums.map(|sum| sum as f32);
    let shown: Vec<f32> = sample.gray.values.iter().copied().filter(|value| *value >= SHOWN).collect();
    (green > 0.0 && shown.len() >= FEWEST).then_some(())?;
    Some([median(shown)?, red / green, blue / green])
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen, textured};
    use super::*;

    fn found(gain: impl Fn(usize, usize) -> f32, tint: usize) -> Vec<Finding> {
        let cameras = (0..4).map(|camera| {
            let picture = |moment| {
                let mut picture = textured(1.0, 0.0, gain(camera, moment));
                if camera == tint {
                    picture.pixels_mut().for_each(|pixel| pixel.0[2] = (f32::from(pixel.0[2]) * 0.7) as u8);
                }
                picture
            };
            seen(camera, 4, (0..5).map(picture).collect())
        });
        exposure(&evidence(cameras.collect()))
    }

    #[test]
    fn equal_cameras_have_no_finding() {
        assert_eq!(found(|_, _| 1.0, 9), [], "one exposure");
    }

    #[test]
    fn cameras_that_leave_out_the_background_have_no_finding() {
        let cameras = (0..4).map(|camera| {
            let mut picture = textured(1.0, 0.0, 1.0);
            // Another share of each picture is black, always more than half.
            let black = picture.height() * (6 + camera as u32) / 10;
            picture.enumerate_pixels_mut().filter(|(_, y, _)| *y < black).for_each(|(.., pixel)| pixel.0 = [0; 3]);
            seen(camera, 4, vec![picture; 5])
        });
        assert_eq!(exposure(&evidence(cameras.collect())), [], "what is black is not compared");
    }

    #[test]
    fn a_drift_of_the_exposure_is_named_with_its_size() {
        let found = found(|camera, moment| if camera == 1 { 1.0 - 0.05 * moment as f32 } else { 1.0 }, 9);
        assert_eq!((found.len(), found[0].cameras.clone()), (1, vec!["cam1".to_owned()]), "one camera: {found:?}");
        assert!(found[0].what.contains("by 25 %") || found[0].what.contains("by 26 %"), "1 to 0.8: {}", found[0]);
    }

    #[test]
    fn a_dark_camera_and_a_tint_are_named() {
        let dark = found(|camera, _| if camera == 2 { 0.4 } else { 1.0 }, 9);
        assert_eq!((dark.len(), dark[0].subject), (1, Subject::Exposure), "dark: {dark:?}");
        let tint = found(|_, _| 1.0, 3);
        assert_eq!((tint.len(), tint[0].subject), (1, Subject::WhiteBalance), "tinted: {tint:?}");
        assert_eq!(tint[0].cameras, ["cam3"], "the last");
    }
}
