//! `sort`: a stable sort by an unsigned key; CPU reference of `shaders/global_sort/sort.wgsl`.
//!
//! In: items and their key. Out: the items in order; items of equal keys keep their order, so that equal depths stay in
//! the order of the Gaussians.

/// Sorts in place, stably.
pub fn sort<T>(items: &mut [T], key: impl Fn(&T) -> u32) {
    items.sort_by_key(key);
}
