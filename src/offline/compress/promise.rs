//! What a quality promises, and whether a package keeps it.
//!
//! In: a quality, a packed scene, the PSNR of its pictures against those of the original if they were drawn. Out: a
//! sentence for each promise that is not kept, with the remedy.

use super::Quality;
use crate::scene::PackedScene;

/// Largest share of the Gaussians, weighted by opacity, whose rounded mean may be off by more than half of their size.
const COARSE: f64 = 0.01;

/// The remedy for every broken promise.
const REMEDY: &str =
    "choose --quality lossless, which changes no value, or first prune the Gaussians that are far from the others";

impl Quality {
    /// Returns the least PSNR of pictures of a capture, compressed with the settings of the quality, against those of
    /// the original, dB; `None` if the pictures are the same. Most captures have 5 dB more.
    pub fn promise(self) -> Option<f64> {
        match self {
            Self::Small => Some(40.0),
            Self::Balanced => Some(45.0),
            Self::VisuallyLossless => Some(55.0),
            Self::Lossless => None,
        }
    }
}

/// Returns a sentence about each promise that a scene, packed with the settings of the quality, does not keep. `psnr`
/// is the PSNR of its pictures against those of the original, dB.
pub(crate) fn broken_promises(quality: Quality, packed: &PackedScene, psnr: Option<f64>) -> Vec<String> {
    let Some(promised) = quality.promise() else { return Vec::new() };
    let name = Quality::NAMES.iter().find(|(_, other)| *other == quality).map_or("", |(name, _)| name);
    let mut broken = Vec::new();
    if let Some(psnr) = psnr.filter(|psnr| *psnr < promised) {
        broken.push(format!(
            "the pictures of the package have {psnr:.1} dB to those of the original, where the quality {name} promises \
             {promised:.0} dB: {REMEDY}"
        ));
    }
    let share = packed.coarse_share();
    if share > COARSE {
        broken.push(format!(
            "{:.0} % of the Gaussians, weighted by opacity, may be off by more than half of their size, since others are too \
             far from them: {REMEDY}",
            100.0 * share
        ));
    }
    broken
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{Bits, Form, Packing};

    fn packed(bits: Bits) -> PackedScene {
        let scene = synthesize(&SynthSettings { count: 2_000, degree: 0, ..SynthSettings::default() });
        let scene = scene.into_runtime().expect("a synthetic scene can be drawn");
        match scene.pack(&Packing { bits, ..Packing::default() }).expect("the scene fits").form {
            Form::Packed(packed) => packed,
            Form::Sliced(_) => panic!("the scene is packed"),
        }
    }

    #[test]
    fn a_promise_that_is_not_kept_is_stated_with_its_figure() {
        let packed = packed(Bits::default());
        let broken = |quality, psnr| broken_promises(quality, &packed, psnr);
        for quality in [Quality::Small, Quality::Balanced, Quality::VisuallyLossless] {
            assert!(broken(quality, None).is_empty(), "{quality:?}: places are exact, and no picture is drawn");
            assert!(broken(quality, quality.promise()).is_empty(), "{quality:?} keeps its promise");
            let stated = broken(quality, Some(20.2)).join(" ");
            let figures = ["20.2 dB".to_owned(), format!("{:.0} dB", quality.promise().expect("a promise"))];
            assert!(figures.iter().all(|figure| stated.contains(figure)), "{quality:?}: {stated}");
            assert!(stated.contains("--quality lossless"), "{quality:?}: the remedy: {stated}");
        }
        assert!(broken(Quality::Lossless, Some(20.0)).is_empty(), "nothing is changed");
    }

    #[test]
    fn places_that_are_too_coarse_are_stated_without_pictures() {
        let stated = broken_promises(Quality::Small, &packed(Bits { mean: 2, ..Bits::default() }), None).join(" ");
        assert!(stated.contains("% of the Gaussians") && stated.contains("--quality lossless"), "{stated}");
    }
}
