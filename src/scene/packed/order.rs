//! The order in which packed Gaussians are stored: neighbors in space follow each other.
//!
//! In: means. Out: a permutation by Morton code (Z-order), so that blocks have small boxes and columns compress.

use crate::gaussian::Gaussian;

/// Returns the indices of the Gaussians in Morton order of their means; equal codes keep their order.
pub fn morton_order(gaussians: &[Gaussian]) -> Vec<u32> {
    let ends = |axis: usize| {
        gaussians
            .iter()
            .map(|g| g.mean[axis])
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
    };
    let ends = [ends(0), ends(1), ends(2)];
    // One scale for all axes: cells are cubes.
    let size = ends.iter().map(|(low, high)| high - low).fold(f32::MIN_POSITIVE, f32::max);
    let code = |gaussian: &Gaussian| {
        (0..3).fold(0u64, |code, axis| {
            let place = f64::from((gaussian.mean[axis] - ends[axis].0) / size) * f64::from((1u32 << 21) - 1);
            code | spread(place as u64) << axis
        })
    };
    let mut order: Vec<(u64, u32)> = (0u32..).zip(gaussians).map(|(index, gaussian)| (code(gaussian), index)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, index)| index).collect()
}

/// Moves bit `i` of 21 bits to bit `3 i`.
fn spread(value: u64) -> u64 {
    let mut v = value & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreading_moves_bit_i_to_bit_3_i() {
        for bit in 0..21 {
            assert_eq!(spread(1 << bit), 1 << (3 * bit), "bit {bit}");
        }
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
