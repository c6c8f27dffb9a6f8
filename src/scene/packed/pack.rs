//! Packing: from a sliced scene to the packed form.
//!
//! In: a scene in the runtime form, and a [`Packing`]. Out: the same scene in the packed form, its Gaussians in Morton
//! order, with invisible fillers of blocks if some Gaussians are far from the others; or why the packed form cannot
//! hold it. Codebooks of color are trained elsewhere (feature `offline`), and packed by the same functions.

use super::anchor::move_near;
use super::encode::Bits;
use super::order::{Order, is_filler};
use super::scene::{PackedColors, PackedScene};
use crate::gaussian::{Gaussian, Harmonics};
use crate::scene::filter::{FilterKind, TemporalFilter};
use crate::scene::form::Form;
use crate::scene::provenance::TrainedWith;
use crate::scene::runtime_scene::RuntimeScene;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How finely a scene is packed. Default: no visible difference, about 60 dB.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Packing {
    /// Bits of the attributes of the geometry.
    pub bits: Bits,
    /// Color coefficients are rounded to multiples of this, so that they compress; 0 keeps them as they are. A step
    /// above 0 must be a normal number: multiples of a subnormal one are not accurate. Default: 1/256.
    pub color_step: f32,
    /// Whether the Gaussians are in layers, the most important ones first, so that a program that receives a package
    /// can draw it coarsely before all of it is there. Default: no.
    pub progressive: bool,
}

impl Default for Packing {
    fn default() -> Self {
        Self { bits: Bits::default(), color_step: 1.0 / 256.0, progressive: false }
    }
}

/// Why a scene cannot be packed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PackError {
    /// It is packed already: its values would be rounded twice.
    #[error("the scene is packed already: pack the checkpoint or the lossless package that it was made from")]
    AlreadyPacked,
    /// Colors cannot be rounded to multiples of this.
    #[error("colors cannot be rounded to multiples of {0:?}: the step must be 0, or a number from {least:e} up", least = f32::MIN_POSITIVE)]
    ColorStep(f32),
    /// The values of the scene have too large a range.
    #[error("the scene does not fit the packed form ({0}): keep it in the runtime form, or prune it first")]
    Range(&'static str),
    /// A Gaussian could no longer be drawn.
    #[error(
        "Gaussian {index} does not fit the packed form ({reason}): keep the scene in the runtime form, or prune it first"
    )]
    Extreme {
        /// Its index in the scene.
        index: u32,
        /// Its fault after packing.
        reason: &'static str,
    },
}

impl Packing {
    /// Checks that colors can be rounded to multiples of the step.
    ///
    /// # Errors
    /// [`PackError::ColorStep`].
    pub(crate) fn check(&self) -> Result<(), PackError> {
        let step = self.color_step;
        if step == 0.0 || (step.is_normal() && step > 0.0) { Ok(()) } else { Err(PackError::ColorStep(step)) }
    }
}

impl RuntimeScene {
    /// Returns the scene in the packed form, with whole colors and without levels of detail. A support filter is
    /// computed again. If some Gaussians are so far away that the others would lose precision, invisible Gaussians are
    /// added, which fill blocks.
    ///
    /// # Errors
    /// A scene that is packed already, a packing that is invalid, values that the packed form cannot hold.
    pub fn pack(self, packing: &Packing) -> Result<Self, PackError> {
        self.pack_in(packing, |scene| {
            let sliced = scene.form.as_sliced().ok_or(PackError::AlreadyPacked)?;
            Ok(Order::of(&sliced.gaussians, packing.progressive))
        })
    }

    /// As [`pack`](Self::pack), in the order that `order` returns for the Gaussians as they will be encoded.
    ///
    /// # Errors
    /// As [`pack`](Self::pack), and those of `order`.
    pub(crate) fn pack_in<E: From<PackError>>(
        mut self,
        packing: &Packing,
        order: impl FnOnce(&Self) -> Result<Order, E>,
    ) -> Result<Self, E> {
        packing.check()?;
        let Form::Sliced(sliced) = &mut self.form else { return Err(PackError::AlreadyPacked.into()) };
        move_near(sliced, &self.trained_with);
        let order = order(&self)?;
        let Form::Sliced(sliced) = &self.form else { return Err(PackError::AlreadyPacked.into()) };
        let colors = PackedColors::Whole(rounded(sliced.harmonics.select(&order.indices), packing.color_step));
        Ok(pack_ordered(self, &packing.bits, &order, colors, [0.0; 2])?)
    }
}

/// Packs a sliced scene whose temporal means are near the interval in the given order, with colors and their range in
/// that order.
///
/// # Errors
/// As [`RuntimeScene::pack`].
pub(crate) fn pack_ordered(
    scene: RuntimeScene,
    bits: &Bits,
    order: &Order,
    colors: PackedColors,
    base: [f32; 2],
) -> Result<RuntimeScene, PackError> {
    let Form::Sliced(sliced) = &scene.form else { return Err(PackError::AlreadyPacked) };
    let TrainedWith { time_interval, marginal_cutoff, .. } = scene.trained_with;
    let Order { indices: order, layers, runs } = order;
    let encoded = encode_ordered(&sliced.gaussians, order, bits, colors, base, scene.trained_with.time_span());
    let packed = PackedScene { layers: layers.clone(), runs: runs.clone(), ..encoded };
    packed.check().map_err(PackError::Range)?;
    check_each(&packed, order)?;
    let filter = scene.filter.map(|filter| match filter.kind {
        // Lifespans are rounded too: the filter must be exact for the Gaussians that are drawn.
        FilterKind::Support => {
            let gaussians = (0..packed.len()).map(|index| packed.gaussian(index));
            TemporalFilter::support(gaussians, time_interval, marginal_cutoff, filter.segments)
        }
        FilterKind::KeyFrame | FilterKind::Interval | FilterKind::Window => filter.select(order),
    });
    Ok(RuntimeScene { form: Form::Packed(packed), filter, levels: Vec::new(), ..scene })
}

/// Packs Gaussians in the given order; fillers have opacity 0.
pub(crate) fn encode_ordered(
    gaussians: &[Gaussian],
    order: &[u32],
    bits: &Bits,
    colors: PackedColors,
    base: [f32; 2],
    reach: f32,
) -> PackedScene {
    let at = |(place, &index): (usize, &u32)| {
        let gaussian = gaussians[index as usize];
        if is_filler(order, place) { Gaussian { opacity: 0.0, ..gaussian } } else { gaussian }
    };
    let ordered: Vec<Gaussian> = order.iter().enumerate().map(at).collect();
    PackedScene::encode(&ordered, bits, colors, base, reach)
}

/// Checks that every Gaussian can still be drawn; `order` has their indices before they were packed.
///
/// # Errors
/// The first that cannot.
pub(crate) fn check_each(packed: &PackedScene, order: &[u32]) -> Result<(), PackError> {
    let reason = |place: usize| packed.gaussian(place).check().err();
    let extreme = |place| Some(PackError::Extreme { index: order[place], reason: reason(place)? });
    (0..order.len()).into_par_iter().find_map_first(extreme).map_or(Ok(()), Err)
}

/// Rounds coefficients to multiples of `step`, if it is positive. Those whose multiple single precision cannot hold
/// stay as they are.
fn rounded(mut harmonics: Harmonics, step: f32) -> Harmonics {
    let multiple = |value: f32| (value / step).round() * step;
    if step > 0.0 {
        let coarse = harmonics.values.iter_mut().filter(|value| multiple(**value).is_finite());
        coarse.for_each(|value| *value = multiple(*value));
    }
    harmonics
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};

    fn sliced() -> RuntimeScene {
        let scene = synthesize(&SynthSettings { count: 300, ..SynthSettings::default() });
        scene.into_runtime().expect("a synthetic scene can be drawn")
    }

    #[test]
    fn packed_gaussians_are_close_to_those_of_the_scene() {
        let scene = sliced();
        let order = Order::of(&scene.iter().collect::<Vec<_>>(), false).indices;
        let packed = scene.clone().pack(&Packing::default()).expect("the scene fits");
        let size = |scene: &RuntimeScene| scene.form.size();
        assert!(matches!(packed.form, Form::Packed(_)) && size(&packed) < size(&scene), "packed and smaller");
        for (place, &index) in order.iter().enumerate() {
            let (a, b) = (packed.gaussian(place), scene.gaussian(index as usize));
            let distance = (0..3).map(|axis| (a.mean[axis] - b.mean[axis]).abs()).fold(0.0, f32::max);
            assert!(distance < 1e-3 && (a.opacity - b.opacity).abs() < 1e-2, "{index}: {a:?} is {b:?}");
        }
    }

    #[test]
    fn packed_scenes_and_invalid_color_steps_are_refused() {
        let packed = sliced().pack(&Packing::default()).expect("the scene fits");
        assert_eq!(
            packed.pack(&Packing::default()).err(),
            Some(PackError::AlreadyPacked),
            "a packed scene would be rounded twice"
        );
        for color_step in [-1.0, f32::NAN, 1e-40] {
            let refused = sliced().pack(&Packing { color_step, ..Packing::default() });
            assert!(matches!(refused, Err(PackError::ColorStep(_))), "a step of {color_step} is refused");
        }
    }
}
