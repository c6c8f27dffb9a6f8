//! The order in which packed Gaussians are stored: neighbors in space follow each other.
//!
//! In: means. Out: a permutation by Morton code (Z-order), so that blocks have small boxes and columns compress. If
//! some Gaussians are so far away that the others would lose precision, the order also has fillers ([`is_filler`]), so
//! that distant Gaussians are in blocks of their own.

use super::morton::by_code;
pub use super::morton::is_filler;
use super::strays::set_apart;
use crate::gaussian::Gaussian;

/// Returns the indices of the Gaussians in Morton order of their means; equal codes keep their order. If blocks would
/// lose precision, Gaussians far from the others are last, and groups far apart begin a block each.
pub fn morton_order(gaussians: &[Gaussian]) -> Vec<u32> {
    let order = by_code(gaussians, (0..gaussians.len() as u32).collect());
    set_apart(gaussians, order)
}

#[cfg(test)]
mod tests {
    use super::*;

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
