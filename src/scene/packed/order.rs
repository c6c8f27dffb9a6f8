//! The order in which packed Gaussians are stored: neighbors in space follow each other.
//!
//! In: Gaussians. Out: a permutation by the Morton code (Z-order) of their means, so that blocks have small boxes and
//! columns compress; a progressive order has layers, the most important Gaussians first, each in Morton order. If some
//! Gaussians are so far away that the others would lose precision, the order also has fillers ([`is_filler`]), so that
//! distant Gaussians are in blocks of their own. Fillers also end a layer, which has whole blocks. The order of chunk
//! files has the parts of [`Runs`] in each layer, which end as layers do.

use super::lanes::BLOCK;
use super::morton::by_code;
pub use super::morton::is_filler;
use super::runs::{Part, RunPart, Runs};
use super::strays::{append, most, set_apart};
use crate::gaussian::Gaussian;
use rayon::prelude::*;

/// Each layer of a progressive order but the last ends at the total number of blocks divided by one of these: a quarter
/// of the Gaussians, then a half.
const LAYERS: [usize; 2] = [4, 2];

/// The order of the Gaussians of a packed scene.
pub struct Order {
    /// The index of the Gaussian at each place.
    pub indices: Vec<u32>,
    /// The places at which the layers but the last end, ascending: multiples of [`BLOCK`].
    pub layers: Vec<usize>,
    /// Which places are in which chunk file, in the order of chunk files.
    pub runs: Option<Runs>,
}

impl Order {
    /// Returns the order of chunk files: of `stretches` stretches of time, these parts, which have each Gaussian once.
    pub(crate) fn of_parts(gaussians: &[Gaussian], stretches: u32, mut parts: Vec<Part>) -> Self {
        parts.sort_by_key(|part| (part.layer, part.stretches));
        let build = |arranged: fn(&[Gaussian], Vec<u32>) -> Vec<u32>| {
            let (mut indices, mut ends) = (Vec::with_capacity(gaussians.len()), Vec::with_capacity(parts.len()));
            for Part { stretches, layer, gaussians: members } in &parts {
                let own: Vec<Gaussian> = members.iter().map(|&index| gaussians[index as usize]).collect();
                let order = arranged(&own, by_code(&own, (0..own.len() as u32).collect()));
                let order: Vec<u32> = order.into_iter().map(|place| members[place as usize]).collect();
                append(&mut indices, &order);
                let end = indices.len().next_multiple_of(BLOCK);
                ends.push(RunPart { stretches: *stretches, layer: *layer, end });
            }
            if let Some(last) = ends.last_mut() {
                last.end = indices.len();
            }
            (indices, ends)
        };
        let (mut indices, mut ends) = build(set_apart);
        // The last block of each part has fillers in any case.
        if indices.len() > most(gaussians.len()) + parts.len() * BLOCK {
            (indices, ends) = build(|_, order| order);
        }
        let runs = Runs { stretches, parts: ends };
        Self { indices, layers: runs.layers(), runs: Some(runs) }
    }

    /// Returns the Morton order, or the progressive one.
    pub fn of(gaussians: &[Gaussian], progressive: bool) -> Self {
        if progressive {
            progressive_order(gaussians)
        } else {
            Self { indices: morton_order(gaussians), layers: Vec::new(), runs: None }
        }
    }
}

/// Returns the Gaussians in layers of descending [importance](Gaussian::importance), each in Morton order; in one layer
/// if several would have too many fillers.
fn progressive_order(gaussians: &[Gaussian]) -> Order {
    let importances: Vec<f32> = gaussians.par_iter().map(Gaussian::importance).collect();
    let key = |index: &u32| importances[*index as usize];
    let mut sorted: Vec<u32> = (0..gaussians.len() as u32).collect();
    sorted.sort_unstable_by(|a, b| key(b).total_cmp(&key(a)).then(a.cmp(b)));
    let blocks = sorted.len().div_ceil(BLOCK);
    let ends = LAYERS.map(|divisor| blocks.div_ceil(divisor) * BLOCK);
    let (mut order, mut start) = (Order { indices: Vec::new(), layers: Vec::new(), runs: None }, 0);
    for end in ends.into_iter().chain([sorted.len()]) {
        let layer = sorted.get(start..end.min(sorted.len())).unwrap_or_default();
        if layer.is_empty() {
            continue;
        }
        if start > 0 {
            order.layers.push(order.indices.len().next_multiple_of(BLOCK));
        }
        append(&mut order.indices, &set_apart(gaussians, by_code(gaussians, layer.to_vec())));
        start += layer.len();
    }
    if order.indices.len() > most(gaussians.len()) {
        return Order { indices: morton_order(gaussians), layers: Vec::new(), runs: None };
    }
    order
}

/// Returns the indices of the Gaussians in Morton order of their means; equal codes keep their order. If blocks would
/// lose precision, Gaussians far from the others are last, and groups far apart begin a block each.
pub fn morton_order(gaussians: &[Gaussian]) -> Vec<u32> {
    let order = by_code(gaussians, (0..gaussians.len() as u32).collect());
    set_apart(gaussians, order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    fn gaussian(random: &mut Random) -> Gaussian {
        let mut within = |low: f32, high: f32| random.in_range(low, high);
        let variance = within(1e-4, 1e-2);
        Gaussian {
            mean: [0; 3].map(|_| within(-1.0, 1.0)),
            covariance: [variance, 0.0, 0.0, variance, 0.0, variance],
            opacity: within(0.1, 1.0),
            ..bytemuck::Zeroable::zeroed()
        }
    }

    #[test]
    fn layers_have_whole_blocks_and_descending_importance() {
        for (count, layers) in [(0, vec![]), (256, vec![]), (300, vec![256]), (10_000, vec![2_560, 5_120])] {
            let mut random = Random::new(1);
            let gaussians: Vec<Gaussian> = (0..count).map(|_| gaussian(&mut random)).collect();
            let order = Order::of(&gaussians, true);
            assert_eq!(order.layers, layers, "{count} Gaussians");
            let mut sorted = order.indices.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..count), "each of {count} indices occurs once");
            let importance = |index: &u32| gaussians[*index as usize].importance();
            for &end in &order.layers {
                let (before, after) = order.indices.split_at(end);
                let least = before.iter().map(importance).fold(f32::INFINITY, f32::min);
                let most = after.iter().map(importance).fold(0.0, f32::max);
                assert!(least >= most, "{least} before the end of a layer, {most} after it");
            }
        }
    }

    #[test]
    fn parts_have_whole_blocks_and_each_gaussian_once() {
        let mut random = Random::new(4);
        let mut gaussians: Vec<Gaussian> = (0..4_000).map(|_| gaussian(&mut random)).collect();
        for stray in gaussians.iter_mut().step_by(500) {
            stray.mean = stray.mean.map(|axis| axis * 1e5);
        }
        let part = |first: u32, layer: u32, gaussians: Vec<u32>| Part { stretches: [first, first], layer, gaussians };
        let every = |offset: u32| (offset..4_000).step_by(3).collect::<Vec<u32>>();
        let parts = vec![part(1, 1, every(0)), part(1, 0, every(1)), part(0, 0, every(2))];
        let order = Order::of_parts(&gaussians, 2, parts.clone());
        let runs = order.runs.expect("runs");
        assert_eq!(runs.check(order.indices.len()), Ok(()), "whole blocks");
        assert_eq!(order.layers, [runs.parts[1].end], "the layer after the most important one");
        let expected = [&parts[2], &parts[1], &parts[0]];
        for ((own, range), Part { stretches, layer, gaussians }) in runs.ranges().zip(expected) {
            assert_eq!((own.stretches, own.layer), (*stretches, *layer), "by layer, then by stretches");
            let places = range.filter(|&place| !is_filler(&order.indices, place));
            let mut found: Vec<u32> = places.map(|place| order.indices[place]).collect();
            found.sort_unstable();
            assert_eq!(found, *gaussians, "the Gaussians of the part, besides fillers");
        }
        assert!(Order::of_parts(&[], 2, Vec::new()).indices.is_empty(), "no Gaussian");
    }

    #[test]
    fn many_groups_far_apart_are_one_layer() {
        let mut random = Random::new(3);
        let of_group = |group: u32| (0..250).map(move |_| group);
        let gaussians: Vec<Gaussian> = (0..400)
            .flat_map(of_group)
            .map(|group| {
                let near = gaussian(&mut random);
                let at = [group % 20, group / 20, 0].map(|axis| 1e3 * axis as f32);
                Gaussian { mean: [0, 1, 2].map(|axis| near.mean[axis] + at[axis]), ..near }
            })
            .collect();
        let order = Order::of(&gaussians, true);
        assert!(order.indices.len() <= most(gaussians.len()), "{} places", order.indices.len());
        assert_eq!(order.layers, [0; 0], "each layer would have a block for each group");
    }

    #[test]
    fn layers_with_strays_end_with_fillers() {
        let mut random = Random::new(2);
        let mut gaussians: Vec<Gaussian> = (0..4_000).map(|_| gaussian(&mut random)).collect();
        for stray in gaussians.iter_mut().step_by(100) {
            stray.mean = stray.mean.map(|axis| axis * 1e5);
        }
        let order = Order::of(&gaussians, true);
        assert!(order.indices.len() > 4_000, "strays have blocks of their own");
        assert_eq!(order.layers.len(), 2, "three layers");
        assert!(order.layers.iter().all(|end| end.is_multiple_of(BLOCK)), "whole blocks: {:?}", order.layers);
        let own = (0..order.indices.len()).filter(|&place| !is_filler(&order.indices, place));
        let mut own: Vec<u32> = own.map(|place| order.indices[place]).collect();
        own.sort_unstable();
        assert!(own.into_iter().eq(0..4_000), "each index occurs once, besides fillers");
    }

    #[test]
    fn the_order_is_a_permutation_in_which_neighbors_are_close() {
        let at = |i: usize| Gaussian {
            mean: [(i * 37 % 50) as f32, (i * 91 % 50) as f32, (i * 13 % 50) as f32],
            ..bytemuck::Zeroable::zeroed()
        };
        let gaussians: Vec<_> = (0..2_000).map(at).collect();
        let order = morton_order(&gaussians);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..2_000), "each index occurs once");
        let step = |a: u32, b: u32| {
            let (a, b) = (gaussians[a as usize].mean, gaussians[b as usize].mean);
            (0..3).map(|axis| (a[axis] - b[axis]).abs()).sum::<f32>()
        };
        let along = |order: &[u32]| order.windows(2).map(|pair| step(pair[0], pair[1])).sum::<f32>();
        let stored: Vec<u32> = (0..2_000).collect();
        assert!(along(&order) < 0.4 * along(&stored), "neighbors in space follow each other");
    }
}
