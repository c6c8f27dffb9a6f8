//! Random words by hashing; CPU reference of `shaders/offline/shared/random.wgsl`.
//!
//! In: the index of a Gaussian, the seed of a step. Out: a random word, the same on every run.

/// Distance between two seeds of the words of one Gaussian.
pub(crate) const STRIDE: u32 = 0x9e37_79b9;

/// Returns the random word of a Gaussian at a step, which `seed` names.
pub(crate) fn word_of(index: u32, seed: u32) -> u32 {
    mixed(seed ^ mixed(index.wrapping_add(STRIDE)))
}

/// Returns a word of which each bit depends on every bit of the argument.
pub(crate) fn mixed(word: u32) -> u32 {
    let z = (word ^ (word >> 16)).wrapping_mul(0x85eb_ca6b);
    let z = (z ^ (z >> 13)).wrapping_mul(0xc2b2_ae35);
    z ^ (z >> 16)
}
