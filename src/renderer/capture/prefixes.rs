//! Prefixes: as many Gaussians of a capture in layers as can matter when it is thinned.
//!
//! In: a scene whose Gaussians are in layers of descending importance; the least importance that is drawn. Out: the
//! shortest prefix that has all Gaussians above it, so that a thinned capture is not read whole.

use crate::scene::{Form, PackedScene, RuntimeScene};
use rayon::prelude::*;

/// The Gaussians up to the end of a layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::renderer) struct Prefix {
    /// Their number.
    pub end: usize,
    /// No Gaussian after them is more important, capture units.
    rest: f32,
}

/// The prefixes of a capture, shortest first; none if its Gaussians are not in layers.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::renderer) struct Prefixes(Vec<Prefix>);

impl Prefixes {
    /// Returns the prefixes of a scene. Layers of chunk files are not of descending importance.
    pub(super) fn of(scene: &RuntimeScene) -> Self {
        let Form::Packed(PackedScene { layers, runs: None, .. }) = &scene.form else { return Self::default() };
        let importance = |index: usize| scene.gaussian(index).importance();
        let most = |from: usize, to: usize| (from..to).into_par_iter().map(importance).reduce(|| 0.0, f32::max);
        let ends = layers.iter().skip(1).copied().chain([scene.len()]);
        let mut prefixes: Vec<Prefix> =
            layers.iter().zip(ends).map(|(&end, next)| Prefix { end, rest: most(end, next) }).collect();
        // Packing may have changed the order a little.
        let mut rest = 0.0_f32;
        for prefix in prefixes.iter_mut().rev() {
            rest = rest.max(prefix.rest);
            prefix.rest = rest;
        }
        Self(prefixes)
    }

    /// Returns all prefixes.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Prefix> {
        self.0.iter()
    }

    /// Returns the index of the shortest prefix with all Gaussians of more than the importance `least`, and the prefix;
    /// `None`: all Gaussians of the capture.
    pub(in crate::renderer) fn needed(&self, least: f32) -> Option<(usize, Prefix)> {
        self.0.iter().position(|prefix| least > 0.0 && prefix.rest <= least).map(|index| (index, self.0[index]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{Importances, Packing};

    #[test]
    fn a_prefix_has_every_gaussian_that_is_drawn() {
        let scene = synthesize(&SynthSettings { count: 9000, ..SynthSettings::default() });
        let scene = scene.into_runtime().expect("it can be drawn");
        let packing = Packing { progressive: true, ..Packing::default() };
        let packed = scene.clone().pack(&packing).expect("the scene fits");
        let (prefixes, importances) = (Prefixes::of(&packed), Importances::of(&packed));
        assert_eq!(prefixes.iter().count(), 2, "three layers");
        assert_eq!(prefixes.needed(0.0), None, "all Gaussians without thinning");
        let mut ends = Vec::new();
        for share in [0.0, 0.05, 0.2, 0.4, 0.7] {
            let least = importances.least_of(share);
            let end = prefixes.needed(least).map_or(packed.len(), |(_, prefix)| prefix.end);
            let drawn = |index: &usize| packed.gaussian(*index).importance() > least;
            assert_eq!((end..packed.len()).filter(drawn).count(), 0, "no Gaussian after {end} is drawn");
            ends.push(end);
        }
        assert!(ends.is_sorted() && ends[1] < packed.len(), "a small share is in the first layers: {ends:?}");
        assert_eq!(ends[4], packed.len(), "a large share in all layers: {ends:?}");
        assert_eq!(Prefixes::of(&scene), Prefixes::default(), "a capture that is not in layers");
    }
}
