//! Morton codes (Z-order).
//!
//! In: means of Gaussians. Out: their indices in the order of the codes; which places of such an order are fillers.

use crate::gaussian::Gaussian;

/// Returns whether the entry at `place` of an order is a filler of a block: it repeats the entry before. A filler is
/// stored with opacity 0.
pub fn is_filler(order: &[u32], place: usize) -> bool {
    place > 0 && order[place] == order[place - 1]
}

/// Returns these indices in Morton order of the means of their Gaussians.
pub(super) fn by_code(gaussians: &[Gaussian], indices: Vec<u32>) -> Vec<u32> {
    let mean = |index: u32| gaussians[index as usize].mean;
    let ends = |axis: usize| {
        indices
            .iter()
            .map(|&index| mean(index)[axis])
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
    };
    let ends = [ends(0), ends(1), ends(2)];
    // One scale for all axes: cells are cubes.
    let size = ends.iter().map(|(low, high)| high - low).fold(f32::MIN_POSITIVE, f32::max);
    let code = |mean: [f32; 3]| {
        (0..3).fold(0u64, |code, axis| {
            let place = f64::from((mean[axis] - ends[axis].0) / size) * f64::from((1u32 << 21) - 1);
            code | spread(place as u64) << axis
        })
    };
    let mut order: Vec<(u64, u32)> = indices.into_iter().map(|index| (code(mean(index)), index)).collect();
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
}
