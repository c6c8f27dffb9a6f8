//! Strays, which are Gaussians far from all others, and groups of Gaussians far from each other: a block that mixes
//! them has such a large box that the steps of its means are larger than its Gaussians.
//!
//! In: Gaussians in Morton order. Out: whether blocks lose precision for this reason; if so, an order in which each
//! group of neighbors begins a block, and strays are in the last blocks, those at similar distances together.

use super::lanes::BLOCK;
use super::morton::{by_code, is_filler};
use crate::gaussian::Gaussian;
use crate::scene::Bounds;
use glam::{DVec3, Vec3};

/// Number of steps of a mean along the longest side of the box of its block, with the usual number of bits.
const STEPS: f64 = 2048.0;
/// A block loses precision if its squared steps, weighted by squared opacity, are more than this fraction of the
/// squared sizes of its Gaussians. The fraction is at most 1/300 in blocks of trained captures.
const COARSE: f64 = 1.0 / 32.0;
/// Upper limit of squared sizes in that sum, in medians of the block: large Gaussians do not compensate for steps that
/// are coarse for the others.
const LARGE: f64 = 4.0;
/// The new order is used if it reduces the [`error`] to less than this fraction.
const GAIN: f64 = 0.75;
/// Largest number of fillers: those of this many blocks, and one for every four Gaussians.
const FILLED: usize = 16;
/// Number of Gaussians in a window. The sizes of windows measure how far apart neighbors are.
const WINDOW: usize = 8;
/// Number of blocks before and after a block whose windows are included in its median.
const AROUND: usize = 4;
/// Two consecutive Gaussians that are farther apart than this many median window sizes are not neighbors.
const GAP: f64 = 32.0;
/// Least number of Gaussians of a group: those of smaller groups are strays.
const FEWEST: usize = 32;
/// Largest number of rounds of the search for strays. Without the strays of one round the Morton order is finer, and
/// the next round finds nearer strays.
const ROUNDS: usize = 16;
/// Largest ratio of the distances of two strays that share blocks, which have 16 bits.
const WIDE: f64 = 64.0;

/// Returns whether a nonempty block loses precision: its means are so far apart that the usual steps are coarse for the
/// sizes of its Gaussians.
pub(super) fn loses_precision<'a>(block: impl Iterator<Item = &'a Gaussian> + Clone) -> bool {
    let squared_step = step(block.clone()).powi(2);
    let mut sizes: Vec<f64> = block.clone().map(squared_size).collect();
    let middle = sizes.len() / 2;
    let most = LARGE * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    let (error, size) = block.fold((0.0, 0.0), |(error, size), gaussian| {
        let (weight, own) = (squared_opacity(gaussian), squared_size(gaussian).min(most));
        (error + weight * own.min(squared_step), size + weight * own)
    });
    error > COARSE * size
}

/// Returns an order with strays and groups in blocks of their own if blocks lose precision and that order reduces the
/// error; otherwise the given order.
pub(super) fn set_apart(gaussians: &[Gaussian], order: Vec<u32>) -> Vec<u32> {
    let at = |&index: &u32| &gaussians[index as usize];
    if !order.chunks(BLOCK).any(|block| loses_precision(block.iter().map(at))) {
        return order;
    }
    let (near, strays) = separated(gaussians, &order);
    let mut is_stray = vec![false; gaussians.len()];
    strays.iter().for_each(|&index| is_stray[index as usize] = true);
    let apart = arranged(gaussians, &near, strays);
    let is_finer = || error(gaussians, &apart, &is_stray) < GAIN * error(gaussians, &order, &is_stray);
    if apart.len() <= most(gaussians.len()) && is_finer() { apart } else { order }
}

/// Returns the largest number of places of an order of this many Gaussians, with its fillers.
pub(super) fn most(count: usize) -> usize {
    count + count / 4 + FILLED * BLOCK
}

/// Returns the sum of the squared errors of all means but those of strays, weighted by squared opacity. An error counts
/// at most as the size of its Gaussian: larger errors look no worse.
fn error(gaussians: &[Gaussian], order: &[u32], is_stray: &[bool]) -> f64 {
    let of_block = |block: &[u32]| {
        let squared_step = step(block.iter().map(|&index| &gaussians[index as usize])).powi(2);
        let own = |gaussian: &Gaussian| squared_opacity(gaussian) * squared_size(gaussian).min(squared_step);
        let counts = |&place: &usize| !is_stray[block[place] as usize] && !is_filler(block, place);
        let places = (0..block.len()).filter(counts);
        places.map(|place| own(&gaussians[block[place] as usize])).sum::<f64>()
    };
    order.chunks(BLOCK).map(of_block).sum()
}

/// Returns the square of the size of a Gaussian: the sum of its variances.
pub(super) fn squared_size(gaussian: &Gaussian) -> f64 {
    let [xx, _, _, yy, _, zz] = gaussian.covariance.map(f64::from);
    xx + yy + zz
}

fn squared_opacity(gaussian: &Gaussian) -> f64 {
    f64::from(gaussian.opacity).powi(2)
}

/// Returns the usual step of the means of a block.
fn step<'a>(block: impl Iterator<Item = &'a Gaussian>) -> f64 {
    extent(block.map(|gaussian| gaussian.mean)) / STEPS
}

/// Returns the longest side of the box of these places.
fn extent(places: impl Iterator<Item = [f32; 3]>) -> f64 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for place in places.map(|place| Vec3::from(place).as_dvec3()) {
        (low, high) = (low.min(place), high.max(place));
    }
    (high - low).max_element().max(0.0)
}

/// Returns the Gaussians that are not strays, in Morton order, and the strays.
fn separated(gaussians: &[Gaussian], order: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (mut near, mut strays) = (order.to_vec(), Vec::new());
    for _ in 0..ROUNDS {
        let (rest, far) = divided(gaussians, &near);
        if far.is_empty() {
            break;
        }
        strays.extend(far);
        near = by_code(gaussians, rest);
    }
    (near, strays)
}

/// Returns the Gaussians of large groups of neighbors, in some order, and all others.
fn divided(gaussians: &[Gaussian], order: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let gaps = gaps(gaussians, order);
    let (mut near, mut far): (Vec<u32>, Vec<u32>) = (Vec::with_capacity(order.len()), Vec::new());
    let mut groups = groups(gaussians, order, &gaps);
    let first = groups.iter().position(|(_, group)| group.len() >= FEWEST);
    groups.rotate_left(first.unwrap_or(0));
    for (start, group) in groups {
        // A group may continue after strays that divide it.
        let ends = near.last().zip(group.first());
        let goes_on = ends.is_some_and(|(&a, &b)| distance(gaussians, a, b) <= gaps[start / BLOCK]);
        let side = if goes_on || group.len() >= FEWEST { &mut near } else { &mut far };
        side.extend(group);
    }
    (near, far)
}

/// Returns the groups of neighbors in an order, each with the place of its first Gaussian.
fn groups<'o>(gaussians: &[Gaussian], order: &'o [u32], gaps: &[f64]) -> Vec<(usize, &'o [u32])> {
    let is_first = |&place: &usize| distance(gaussians, order[place - 1], order[place]) > gaps[place / BLOCK];
    let mut ends: Vec<usize> = std::iter::once(0).chain((1..order.len()).filter(is_first)).collect();
    ends.push(order.len());
    ends.windows(2).map(|ends| (ends[0], &order[ends[0]..ends[1]])).collect()
}

/// Returns for each block of an order the distance beyond which consecutive Gaussians are not neighbors.
fn gaps(gaussians: &[Gaussian], order: &[u32]) -> Vec<f64> {
    let size = |window: &[u32]| extent(window.iter().map(|&index| gaussians[index as usize].mean));
    let windows: Vec<f64> = order.chunks(WINDOW).map(size).collect();
    let of_block = |block: usize| {
        let last = (block + AROUND + 1) * (BLOCK / WINDOW);
        let mut around = windows[block.saturating_sub(AROUND) * (BLOCK / WINDOW)..last.min(windows.len())].to_vec();
        let middle = around.len() / 2;
        GAP * *around.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    (0..order.len().div_ceil(BLOCK)).map(of_block).collect()
}

/// Returns the largest difference of two means along an axis.
fn distance(gaussians: &[Gaussian], a: u32, b: u32) -> f64 {
    let [a, b] = [a, b].map(|index| Vec3::from(gaussians[index as usize].mean).as_dvec3());
    (a - b).abs().max_element()
}

/// Returns an order in which each group of neighbors, and each shell of strays, begins a block.
fn arranged(gaussians: &[Gaussian], near: &[u32], strays: Vec<u32>) -> Vec<u32> {
    let mut order = Vec::new();
    let gaps = gaps(gaussians, near);
    for (_, group) in groups(gaussians, near, &gaps) {
        append(&mut order, group);
    }
    for shell in shells(gaussians, near, strays) {
        append(&mut order, &by_code(gaussians, shell));
    }
    order
}

/// Appends Gaussians from the beginning of a block on: the block before is filled with copies of its last Gaussian.
pub(super) fn append(order: &mut Vec<u32>, group: &[u32]) {
    if let Some(&last) = order.last() {
        order.resize(order.len().next_multiple_of(BLOCK), last);
    }
    order.extend(group);
}

/// Returns the strays in shells of similar distances from the core of the other Gaussians, the nearest first.
fn shells(gaussians: &[Gaussian], near: &[u32], strays: Vec<u32>) -> Vec<Vec<u32>> {
    let mean = |&index: &u32| gaussians[index as usize].mean;
    let around: &[u32] = if near.is_empty() { &strays } else { near };
    let core = Bounds::core_of(&around.iter().map(mean).collect::<Vec<_>>());
    let center = core.map_or(DVec3::ZERO, |core| core.min.as_dvec3().midpoint(core.max.as_dvec3()));
    let away = |index: u32| ((Vec3::from(mean(&index)).as_dvec3() - center).abs().max_element(), index);
    let mut placed: Vec<(f64, u32)> = strays.into_iter().map(away).collect();
    placed.sort_unstable_by(|(a, i), (b, j)| a.total_cmp(b).then(i.cmp(j)));
    let (mut shells, mut nearest): (Vec<Vec<u32>>, f64) = (Vec::new(), 0.0);
    for (distance, index) in placed {
        match shells.last_mut() {
            Some(shell) if distance <= WIDE * nearest => shell.push(index),
            _ => {
                nearest = distance;
                shells.push(vec![index]);
            }
        }
    }
    shells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    fn morton_order(gaussians: &[Gaussian]) -> Vec<u32> {
        set_apart(gaussians, by_code(gaussians, (0..gaussians.len() as u32).collect()))
    }

    /// Returns a Gaussian of the size 0.02 √3 at a place.
    fn gaussian(mean: DVec3) -> Gaussian {
        let covariance = [4e-4, 0.0, 0.0, 4e-4, 0.0, 4e-4];
        Gaussian { mean: mean.as_vec3().to_array(), covariance, opacity: 0.9, ..bytemuck::Zeroable::zeroed() }
    }

    /// Returns Gaussians in a cube of two units around a place.
    fn cloud(count: usize, around: DVec3, random: &mut Random) -> Vec<Gaussian> {
        let mut within = || f64::from(random.in_range(-1.0, 1.0));
        (0..count).map(|_| gaussian(around + DVec3::new(within(), within(), within()))).collect()
    }

    /// Returns Gaussians in all directions at this distance.
    fn scattered(count: usize, distance: f64, random: &mut Random) -> Vec<Gaussian> {
        let mut within = || f64::from(random.in_range(-1.0, 1.0));
        let mut direction = || DVec3::new(within(), within(), within()).normalize_or(DVec3::X);
        (0..count).map(|_| gaussian(direction() * distance)).collect()
    }

    /// Returns the longest side of the box of each block, after checking that the order has every Gaussian once,
    /// besides fillers.
    fn largest_boxes(gaussians: &[Gaussian], order: &[u32]) -> Vec<f64> {
        let mut own: Vec<u32> = (0..order.len()).filter(|&at| !is_filler(order, at)).map(|at| order[at]).collect();
        own.sort_unstable();
        assert!(own.into_iter().eq(0..gaussians.len() as u32), "every Gaussian is in the order once");
        order.chunks(BLOCK).map(|block| extent(block.iter().map(|&index| gaussians[index as usize].mean))).collect()
    }

    #[test]
    fn gaussians_without_strays_stay_in_morton_order() {
        let mut random = Random::new(1);
        for count in [0, 1, 255, 4_000] {
            let gaussians = cloud(count, DVec3::ZERO, &mut random);
            let plain = by_code(&gaussians, (0..count as u32).collect());
            assert_eq!(morton_order(&gaussians), plain, "{count} Gaussians without strays");
        }
        let mut gaussians = cloud(4_000, DVec3::ZERO, &mut random);
        gaussians.extend(cloud(50, DVec3::splat(2.0), &mut random));
        let plain = by_code(&gaussians, (0..4_050).collect());
        assert_eq!(morton_order(&gaussians), plain, "a few Gaussians next to the others cost no precision");
    }

    #[test]
    fn strays_have_the_last_blocks() {
        for distance in [100.0, 1e3, 1e6, 1e30] {
            for (count, strays) in [(300, 10), (3_980, 20), (3_980, 400)] {
                let mut random = Random::new(2);
                let mut gaussians = scattered(strays, distance, &mut random);
                gaussians.extend(cloud(count, DVec3::ZERO, &mut random));
                let order = morton_order(&gaussians);
                let boxes = largest_boxes(&gaussians, &order);
                let (near, far): (Vec<f64>, Vec<f64>) = boxes.iter().partition(|&&size| size < 3.0);
                assert_eq!(far.len(), strays.div_ceil(BLOCK), "{strays} strays at {distance}: {boxes:?}");
                assert!(boxes.ends_with(&far), "their blocks are last: {boxes:?}");
                assert!(near.len() <= count.div_ceil(BLOCK) + 1, "the others are in as few blocks: {boxes:?}");
            }
        }
    }

    #[test]
    fn strays_of_different_distances_share_no_block() {
        let mut random = Random::new(3);
        let mut gaussians = cloud(2_000, DVec3::ZERO, &mut random);
        gaussians.extend([30.0, 1e4, 1e6].iter().flat_map(|&distance| scattered(10, distance, &mut random)));
        let boxes = largest_boxes(&gaussians, &morton_order(&gaussians));
        for most in [3.0, 70.0, 2.1e4, 2.1e6] {
            assert!(boxes.iter().any(|size| (most / 4.0..most).contains(size)), "a block up to {most}: {boxes:?}");
        }
    }

    #[test]
    fn groups_far_apart_share_no_block() {
        let mut random = Random::new(4);
        let places = [DVec3::ZERO, DVec3::X * 1e3, DVec3::new(700.0, -300.0, 1e4)];
        let groups = places.iter().zip([1_500, 700, 100]);
        let gaussians: Vec<Gaussian> = groups.flat_map(|(&at, count)| cloud(count, at, &mut random)).collect();
        let boxes = largest_boxes(&gaussians, &morton_order(&gaussians));
        assert!(boxes.iter().all(|&size| size < 2.1), "each block has Gaussians of one group: {boxes:?}");
        assert_eq!(boxes.len(), 6 + 3 + 1, "each group begins a block");
    }
}
