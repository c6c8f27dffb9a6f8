//! Layers: the Gaussians of a run by their importance for pictures.
//!
//! In: the Gaussians of a run, the importance of each, the shares of the layers ([`LayerShares`]). Out: the Gaussians of
//! each layer, so that a player that has the first layers of a run shows most of what is there.

use crate::scene::ChunkTable;
use serde::{Deserialize, Serialize};

/// The shares of the layers, most important first: whole percentages, 100 in all. Default: 25, 25 and 50.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<u32>", into = "Vec<u32>")]
pub struct LayerShares(Vec<u32>);

impl LayerShares {
    /// Returns the shares of these percentages; `None` if one is 0, there are more than [`ChunkTable::MOST_LAYERS`], or
    /// they are not 100 in all.
    pub fn new(percentages: Vec<u32>) -> Option<Self> {
        let sum = percentages.iter().fold(0, |sum: u32, share| sum.saturating_add(*share));
        let is_few = percentages.len() <= ChunkTable::MOST_LAYERS as usize;
        (sum == 100 && is_few && !percentages.contains(&0)).then_some(Self(percentages))
    }

    /// Returns where each layer of `count` Gaussians ends.
    fn ends(&self, count: usize) -> impl Iterator<Item = usize> {
        let shares = self.0.iter().scan(0, |sum, share| {
            *sum += u64::from(*share);
            Some(*sum)
        });
        shares.map(move |share| (count as u64 * share / 100) as usize)
    }
}

impl TryFrom<Vec<u32>> for LayerShares {
    type Error = &'static str;

    fn try_from(percentages: Vec<u32>) -> Result<Self, Self::Error> {
        Self::new(percentages)
            .ok_or("the shares of layers are not whole percentages above 0, 100 in all, of 16 at most")
    }
}

impl From<LayerShares> for Vec<u32> {
    fn from(shares: LayerShares) -> Self {
        shares.0
    }
}

impl Default for LayerShares {
    fn default() -> Self {
        Self(vec![25, 25, 50])
    }
}

/// Returns the layers of the Gaussians of a run, most important first; the Gaussians of each ascend. A layer of
/// fewer Gaussians than `least` is part of the one before it, the first of the one after it.
pub(super) fn layers(gaussians: &[u32], importances: &[f32], shares: &LayerShares, least: usize) -> Vec<Vec<u32>> {
    let mut order = gaussians.to_vec();
    let importance = |index: u32| importances[index as usize];
    // Of equal importance the earlier first: layers that follow one another are cut at the same places again.
    order.sort_unstable_by(|&a, &b| importance(b).total_cmp(&importance(a)).then(a.cmp(&b)));
    let (mut layers, mut start) = (Vec::<Vec<u32>>::new(), 0);
    for end in shares.ends(order.len()) {
        let own = &order[start..end];
        match layers.last_mut() {
            Some(before) if before.len() < least || own.len() < least => before.extend_from_slice(own),
            _ => layers.push(own.to_vec()),
        }
        start = end;
    }
    layers.iter_mut().for_each(|layer| layer.sort_unstable());
    layers
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: usize = 256;

    fn shares(percentages: &[u32]) -> LayerShares {
        LayerShares::new(percentages.to_vec()).expect("shares of 100 in all")
    }

    fn lengths(count: u32, percentages: &[u32]) -> Vec<usize> {
        let gaussians: Vec<u32> = (0..count).collect();
        layers(&gaussians, &vec![1.0; count as usize], &shares(percentages), LEAST).iter().map(Vec::len).collect()
    }

    #[test]
    fn shares_are_a_hundred_in_all() {
        assert_eq!(LayerShares::default(), shares(&[25, 25, 50]), "the default");
        for bad in [&[][..], &[50], &[100, 0], &[50, 60], &[u32::MAX, 101], &[1; 100]] {
            assert_eq!(LayerShares::new(bad.to_vec()), None, "{bad:?}");
        }
    }

    #[test]
    fn few_gaussians_have_fewer_layers() {
        assert_eq!(lengths(2000, &[25, 25, 50]), [500, 500, 1000], "many");
        assert_eq!(lengths(2001, &[25, 25, 50]), [500, 500, 1001], "no Gaussian is left out");
        assert_eq!(lengths(1000, &[25, 25, 50]), [500, 500], "the first is small");
        assert_eq!(lengths(1000, &[50, 49, 1]), [500, 500], "the last is small");
        assert_eq!(lengths(1000, &[80, 10, 10]), [1000], "the last two are small");
        assert_eq!(lengths(100, &[25, 25, 50]), [100], "all are small");
        assert_eq!(lengths(2000, &[100]), [2000], "one layer");
    }

    #[test]
    fn the_more_important_are_first_and_cut_again_they_stay() {
        let importances: Vec<f32> =
            (0..4000_u32).map(|index| (index.wrapping_mul(2_654_435_761) >> 29) as f32).collect();
        let gaussians: Vec<u32> = (0..4000).filter(|index| index % 3 > 0).collect();
        let cut = layers(&gaussians, &importances, &LayerShares::default(), LEAST);
        assert_eq!(cut.len(), 3, "three layers");
        let importance = |index: &u32| importances[*index as usize];
        for pair in cut.windows(2) {
            let least = pair[0].iter().map(importance).fold(f32::INFINITY, f32::min);
            let most = pair[1].iter().map(importance).fold(0.0, f32::max);
            assert!(least >= most, "{least} in a layer, {most} in the next");
        }
        assert!(cut.iter().all(|layer| layer.is_sorted()), "the Gaussians of each ascend");
        // As if the files were joined.
        let joined = cut.concat();
        let moved: Vec<f32> = joined.iter().map(importance).collect();
        let places: Vec<u32> = (0..joined.len() as u32).collect();
        let again = layers(&places, &moved, &LayerShares::default(), LEAST);
        let again: Vec<Vec<u32>> =
            again.iter().map(|layer| layer.iter().map(|place| joined[*place as usize]).collect()).collect();
        assert_eq!(again, cut, "many are equally important, and none changes its layer");
    }
}
