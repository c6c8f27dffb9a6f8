//! Blurred pictures.
//!
//! In: how sharp the middle picture of each camera is at full size. Out: findings about cameras that are out of focus,
//! footage that is blurred in all cameras, and things that are blurred by their motion.

use super::evidence::Evidence;
use super::finding::{Finding, Severity, Subject, listed};
use super::plane::median;
use super::sharpness::NO_DETAIL;

/// Share of the usual fine detail below which a camera is blurred.
const BLURRED: f32 = 0.45;
/// Fine detail below which all are blurred (a blur of two pixels leaves 0.04).
const LITTLE: f32 = 0.06;
/// Share of the fine detail of what stands below which what moves is blurred.
const MOTION: f32 = 0.2;

/// Returns the findings about blur.
pub(super) fn blur(evidence: &Evidence) -> Vec<Finding> {
    let detail = |quotient: f32| (quotient - NO_DETAIL).max(0.0);
    let measured = evidence.cameras.iter().filter_map(|seen| Some((seen.name.as_str(), seen.sharpness?)));
    let measured: Vec<_> = measured.collect();
    let still: Vec<(&str, f32)> =
        measured.iter().filter_map(|(name, sharpness)| Some((*name, detail(sharpness.still?)))).collect();
    let mut findings = Vec::new();
    if let Some(usual) = median(still.iter().map(|(_, detail)| *detail).collect()) {
        if usual < LITTLE {
            let what = "The pictures of most cameras have hardly any fine detail: they are blurred.".to_owned();
            let remedy = "Focus the cameras, or train with pictures of half the size: nothing is lost.";
            findings.push(Finding::new(Severity::Warning, Subject::Blur, what, remedy));
        } else if still.len() > 1 {
            for &(name, own) in still.iter().filter(|(_, own)| *own < BLURRED * usual) {
                let percent = 100.0 * own / usual;
                let what = format!("{name} is blurred: it has {percent:.0} % of the fine detail of the other cameras.");
                let remedy = "Focus it and clean its lens; if it cannot be filmed again, leave it out.";
                findings.push(Finding::new(Severity::Warning, Subject::Blur, what, remedy).about([name]));
            }
        }
    }
    let both = measured.iter().filter_map(|(name, sharpness)| Some((*name, sharpness.moving?, sharpness.still?)));
    let both: Vec<(&str, f32, f32)> = both.filter(|(_, _, still)| detail(*still) >= LITTLE).collect();
    let is_smeared = |&&(_, moving, still): &&(&str, f32, f32)| detail(moving) < MOTION * detail(still);
    let smeared: Vec<&str> = both.iter().filter(is_smeared).map(|(name, ..)| *name).collect();
    if !smeared.is_empty() && 2 * smeared.len() >= both.len() {
        let what = format!("What moves is blurred in {}: the shutter was open too long.", listed(&smeared));
        let remedy = "Film with a shutter of 1/500 s or shorter, and with more light.";
        findings.push(Finding::new(Severity::Warning, Subject::MotionBlur, what, remedy).about(smeared));
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::{evidence, seen};
    use super::super::sharpness::Sharpness;
    use super::*;

    fn found(quotients: &[(f32, Option<f32>)]) -> Vec<Finding> {
        let mut cameras: Vec<_> = (0..quotients.len()).map(|index| seen(index, 4, Vec::new())).collect();
        for (seen, &(still, moving)) in cameras.iter_mut().zip(quotients) {
            seen.sharpness = Some(Sharpness { still: Some(still), moving });
        }
        blur(&evidence(cameras))
    }

    #[test]
    fn a_camera_out_of_focus_is_named() {
        // As measured on four cameras: sharp, and the second blurred by two pixels.
        assert_eq!(found(&[(0.47, None), (0.55, None), (0.78, None), (0.55, None)]), [], "all are sharp");
        let found = found(&[(0.47, None), (0.29, None), (0.78, None), (0.55, None)]);
        assert_eq!(found.len(), 1, "one camera: {found:?}");
        assert_eq!(found[0].cameras, ["cam1"], "the second");
    }

    #[test]
    fn blur_of_all_and_blur_of_motion_are_told_apart() {
        let all = found(&[(0.28, None), (0.29, None), (0.27, None)]);
        assert!(all.len() == 1 && all[0].cameras.is_empty(), "all are blurred: {all:?}");
        let motion = found(&[(0.6, Some(0.28)), (0.5, Some(0.27)), (0.5, Some(0.45))]);
        assert_eq!((motion.len(), motion[0].subject), (1, Subject::MotionBlur), "two of three: {motion:?}");
    }
}
