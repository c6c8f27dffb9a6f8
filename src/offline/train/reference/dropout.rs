//! Dropout of Gaussians; CPU reference of `shaders/offline/dropout.wgsl`.
//!
//! In: the index of a Gaussian, the seed of a step, a share. Out: whether the views of the step are drawn without the
//! Gaussian. With few views of each moment, training fits these views with Gaussians that are wrong in other views. If
//! pictures must be right without a random share of the Gaussians, several Gaussians share each surface, and fewer fit
//! single views.

use super::random_words::word_of;

/// Returns the number below which the random words of this share of the Gaussians lie.
pub(crate) fn below(share: f64) -> u32 {
    (share * 2f64.powi(32)) as u32
}

/// Returns whether a Gaussian is hidden at a step.
pub fn is_dropped(index: u32, seed: u32, share: f64) -> bool {
    word_of(index, seed) < below(share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_is_hidden_and_others_at_each_step() {
        let hidden = |seed| (0..20_000).filter(|&index| is_dropped(index, seed, 0.2)).collect::<Vec<_>>();
        let (first, second) = (hidden(1), hidden(2));
        assert!((first.len() as i64 - 4000).abs() < 200, "a fifth is hidden: {}", first.len());
        let both = first.iter().filter(|index| second.contains(index)).count();
        assert!((both as i64 - 800).abs() < 150, "a fifth of these at the next step as well: {both}");
        assert!(!(0..20_000).any(|index| is_dropped(index, 1, 0.0)), "a share of 0 hides nothing");
    }
}
