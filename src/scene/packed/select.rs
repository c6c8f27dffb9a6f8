//! Some of the Gaussians of a packed scene, without a change of their values.
//!
//! In: a packed scene, the indices of the Gaussians that it keeps. Out: their records, with the ranges of their blocks and the
//! ends of their layers and runs.
//! A record is decoded by the ranges of its block: Gaussians of two blocks never share one, and a block that loses some
//! ends with fillers.

use super::lanes::{BLOCK, BLOCK_RANGES, SHARED_RANGES, hidden};
use super::order::is_filler;
use super::runs::{RunPart, Runs};
use super::scene::{PackedColors, PackedScene};

impl PackedScene {
    /// Returns the Gaussians at these indices, ascending, and the index of each: a filler repeats the index before and
    /// has opacity 0. Blocks without one of them are left out.
    ///
    /// # Panics
    /// If an index is out of range.
    pub(crate) fn select(&self, keep: &[u32]) -> (Self, Vec<u32>) {
        let mut order: Vec<u32> = Vec::with_capacity(keep.len());
        let mut ranges = self.ranges[..SHARED_RANGES].to_vec();
        let block = |index: u32| index as usize / BLOCK;
        for own in keep.chunk_by(|&a, &b| block(a) == block(b)) {
            // Only the last block may be shorter.
            if let Some(&last) = order.last() {
                order.resize(order.len().next_multiple_of(BLOCK), last);
            }
            order.extend_from_slice(own);
            ranges.extend_from_slice(&self.ranges[SHARED_RANGES + block(own[0]) * BLOCK_RANGES..][..BLOCK_RANGES]);
        }
        let record = |(place, &index): (usize, &u32)| {
            let record = self.records[index as usize];
            if is_filler(&order, place) { hidden(record) } else { record }
        };
        let records = order.iter().enumerate().map(record).collect();
        let colors = match &self.colors {
            PackedColors::Whole(harmonics) => PackedColors::Whole(harmonics.select(&order)),
            PackedColors::Coded(colors) => PackedColors::Coded(colors.select(&order)),
        };
        let (layers, runs) = (self.layers_of(&order), self.runs_of(&order));
        (Self { records, ranges, colors, layers, runs }, order)
    }

    /// Returns the runs of an order of some of the Gaussians, whose blocks are those of the scene; `None` if none are
    /// left.
    fn runs_of(&self, order: &[u32]) -> Option<Runs> {
        let Runs { stretches, parts } = self.runs.as_ref()?;
        let end = |part: &RunPart| order.partition_point(|&index| (index as usize) < part.end);
        let whole = |end: usize| end.next_multiple_of(BLOCK).min(order.len());
        let mut own = Vec::with_capacity(parts.len());
        for part in parts {
            let end = whole(end(part));
            if end > own.last().map_or(0, |before: &RunPart| before.end) {
                own.push(RunPart { end, ..*part });
            }
        }
        (!own.is_empty()).then_some(Runs { stretches: *stretches, parts: own })
    }

    /// Returns the ends of the layers of an order of some of the Gaussians, whose blocks are those of the scene.
    fn layers_of(&self, order: &[u32]) -> Vec<usize> {
        let end = |&end: &usize| order.partition_point(|&index| (index as usize) < end).next_multiple_of(BLOCK);
        let mut layers: Vec<usize> = self.layers.iter().map(end).collect();
        layers.dedup();
        layers.retain(|&end| end > 0 && end < order.len());
        layers
    }
}

#[cfg(test)]
mod tests {
    use super::super::pack::Packing;
    use super::*;
    use crate::scene::Form;
    use crate::scene::synth::{SynthSettings, synthesize};

    fn packed(count: usize) -> PackedScene {
        let scene = synthesize(&SynthSettings { count, degree: 1, ..SynthSettings::default() });
        let runtime = scene.into_runtime().expect("a synthetic scene can be drawn");
        match runtime.pack(&Packing::default()).expect("the scene fits").form {
            Form::Packed(packed) => packed,
            Form::Sliced(_) => panic!("the scene is packed"),
        }
    }

    /// Returns the coefficients of a Gaussian.
    fn color(scene: &PackedScene, index: u32) -> Vec<f32> {
        match &scene.colors {
            PackedColors::Whole(harmonics) => harmonics.select(&[index]).values,
            PackedColors::Coded(_) => panic!("colors are whole"),
        }
    }

    #[test]
    fn kept_gaussians_have_the_same_values_and_fillers_are_invisible() {
        let all = packed(1500);
        // Some of the first block, none of the second, all of the third, some of the last two.
        let count = all.len() as u32;
        let is_kept = |index: &u32| match index / 256 {
            0 => index.is_multiple_of(3),
            1 => false,
            2 => true,
            _ => index.is_multiple_of(7),
        };
        let keep: Vec<u32> = (0..count).filter(is_kept).collect();
        let (some, order) = all.select(&keep);
        assert_eq!(some.check(), Ok(()), "records, ranges and colors fit together");
        assert_eq!(some.len(), order.len(), "each record has an index");
        let (mut own, mut fillers) = (Vec::new(), 0);
        for (place, &index) in order.iter().enumerate() {
            let (found, before) = (some.gaussian(place), all.gaussian(index as usize));
            if is_filler(&order, place) {
                fillers += 1;
                assert_eq!(found.opacity, 0.0, "the filler at {place} is invisible");
            } else {
                own.push(index);
                assert_eq!(found, before, "Gaussian {index} has the same values");
                let colors = [(&some, place as u32), (&all, index)].map(|(scene, at)| color(scene, at));
                assert_eq!(colors[0], colors[1], "Gaussian {index} has the same color");
            }
        }
        assert_eq!(own, keep, "every kept Gaussian once, in its order");
        assert!(fillers > 0 && order.len() < all.len(), "{fillers} fillers; the empty block is left out");
    }

    #[test]
    fn layers_keep_the_gaussians_that_are_left() {
        let mut all = packed(1500);
        all.layers = vec![256, 768];
        let layers = |keep: &[u32]| all.select(keep).0.layers;
        assert_eq!(layers(&(0..1500).collect::<Vec<_>>()), [256, 768], "all Gaussians");
        assert_eq!(layers(&[3, 4, 300, 800]), [256, 512], "two blocks in the first two layers");
        assert_eq!(layers(&[300, 800]), [256], "none in the first layer");
        assert_eq!(layers(&[3, 5]), [0; 0], "none behind the first layer");
        assert_eq!(layers(&[900]), [0; 0], "the last layer alone");
    }

    #[test]
    fn runs_keep_the_gaussians_that_are_left() {
        let mut all = packed(1500);
        let part = |first, layer, end| RunPart { stretches: [first, 3], layer, end };
        all.layers = vec![768];
        all.runs = Some(Runs { stretches: 4, parts: vec![part(0, 0, 256), part(1, 0, 768), part(0, 1, 1500)] });
        assert_eq!(all.check(), Ok(()), "runs and layers fit together");
        let ends = |keep: &[u32]| {
            let some = all.select(keep).0;
            assert_eq!(some.check(), Ok(()), "what is left fits together");
            some.runs.map(|runs| runs.parts.iter().map(|part| (part.stretches[0], part.layer, part.end)).collect())
        };
        assert_eq!(ends(&(0..1500).collect::<Vec<_>>()), Some(vec![(0, 0, 256), (1, 0, 768), (0, 1, 1500)]), "all");
        assert_eq!(ends(&(256..768).collect::<Vec<_>>()), Some(vec![(1, 0, 512)]), "a chunk file");
        assert_eq!(ends(&[3, 4, 800]), Some(vec![(0, 0, 256), (0, 1, 257)]), "a part without Gaussians is left out");
        assert_eq!(ends(&[]), None, "none");
    }

    #[test]
    fn all_gaussians_are_the_scene_itself_and_none_are_an_empty_one() {
        let all = packed(600);
        let every: Vec<u32> = (0..all.len() as u32).collect();
        assert_eq!(all.select(&every), (all.clone(), every), "nothing changes");
        let (none, order) = all.select(&[]);
        assert_eq!((none.check(), none.len(), order), (Ok(()), 0, Vec::new()), "a scene without Gaussians");
    }
}
