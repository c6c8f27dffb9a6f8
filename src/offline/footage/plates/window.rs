//! What the squares around pixels hold.
//!
//! In: values, or yes and no, for each pixel of a picture, in the order of rows. Out: the mean, all, or any over the
//! square around each pixel; beyond the border there is nothing.

use glam::UVec2;

/// Returns the mean over the square of `2 radius + 1` pixels around each pixel.
pub(super) fn box_mean(mut values: Vec<f32>, size: UVec2, radius: usize) -> Vec<f32> {
    let mut sums: Vec<f64> = Vec::new();
    lines(&mut values, size, |line| {
        sums.clear();
        sums.push(0.0);
        let mut sum = 0.0;
        sums.extend(line.iter().map(|&value| {
            sum += f64::from(value);
            sum
        }));
        let length = line.len();
        for (at, value) in line.iter_mut().enumerate() {
            let (first, end) = (at.saturating_sub(radius), (at + radius + 1).min(length));
            *value = ((sums[end] - sums[first]) / (end - first) as f64) as f32;
        }
    });
    values
}

/// Returns a mask that has every pixel whose square of `2 radius + 1` pixels holds a pixel of the mask.
pub(super) fn dilated(mask: &[bool], size: UVec2, radius: usize) -> Vec<bool> {
    counted(mask, size, radius, |inside, _| inside > 0)
}

/// Returns a mask that has every pixel whose square of `2 radius + 1` pixels holds pixels of the mask only.
pub(super) fn eroded(mask: &[bool], size: UVec2, radius: usize) -> Vec<bool> {
    counted(mask, size, radius, |inside, all| inside == all)
}

/// Returns what `is_held` says of the number of pixels of the mask in a line of `2 radius + 1` pixels and of the number
/// of its pixels: first for lines across, then for lines down.
fn counted(mask: &[bool], size: UVec2, radius: usize, is_held: impl Fn(usize, usize) -> bool) -> Vec<bool> {
    let mut mask = mask.to_vec();
    let mut counts: Vec<usize> = Vec::new();
    lines(&mut mask, size, |line| {
        counts.clear();
        counts.push(0);
        let mut count = 0;
        counts.extend(line.iter().map(|&inside| {
            count += usize::from(inside);
            count
        }));
        let length = line.len();
        for (at, inside) in line.iter_mut().enumerate() {
            let (first, end) = (at.saturating_sub(radius), (at + radius + 1).min(length));
            *inside = is_held(counts[end] - counts[first], end - first);
        }
    });
    mask
}

/// Changes all rows, then all columns.
fn lines<T: Copy>(values: &mut [T], size: UVec2, mut change: impl FnMut(&mut [T])) {
    let width = size.x as usize;
    if values.is_empty() || width == 0 {
        return;
    }
    values.chunks_exact_mut(width).for_each(&mut change);
    let mut column = Vec::new();
    for x in 0..width {
        column.clear();
        column.extend(values.iter().skip(x).step_by(width).copied());
        change(&mut column);
        values.iter_mut().skip(x).step_by(width).zip(&column).for_each(|(value, &changed)| *value = changed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: UVec2 = UVec2::new(9, 7);

    fn near(index: usize, distance: usize) -> bool {
        (index % 9).abs_diff(4) <= distance && (index / 9).abs_diff(3) <= distance
    }

    #[test]
    fn squares_grow_and_shrink_by_the_radius() {
        let of = |distance| (0..63).map(|index| near(index, distance)).collect::<Vec<bool>>();
        assert_eq!(dilated(&of(0), SIZE, 2), of(2), "a pixel becomes a square of five");
        assert_eq!(eroded(&of(2), SIZE, 1), of(1), "a square of five becomes one of three");
        assert_eq!(eroded(&[true; 63], SIZE, 3), [true; 63], "nothing beyond the border counts");
        assert_eq!(dilated(&[], UVec2::ZERO, 3), Vec::<bool>::new(), "no pixels");
    }

    #[test]
    fn a_mean_is_over_the_square_inside_the_picture() {
        let mean = box_mean((0..63).map(|index| if near(index, 0) { 9.0 } else { 0.0 }).collect(), SIZE, 1);
        let expected: Vec<f32> = (0..63).map(|index| if near(index, 1) { 1.0 } else { 0.0 }).collect();
        assert_eq!(mean, expected, "a ninth in nine pixels");
        let corner = box_mean((0..63).map(|index| if index == 0 { 8.0 } else { 0.0 }).collect(), SIZE, 1);
        assert_eq!(corner[0], 2.0, "four pixels in the corner");
    }
}
