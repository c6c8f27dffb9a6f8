//! Parts: the Gaussians of each chunk file.
//!
//! In: Gaussians, the stretches of time in which each may be drawn ([`lives`]), the shares of the layers. Out: for each
//! layer of each run of Gaussians a [`Part`].

use super::covers::runs;
use super::layers::{LayerShares, layers};
use super::windows::{hulls, intervals};
use crate::gaussian::Gaussian;
use crate::scene::packed::runs::Part;
use crate::scene::{ChunkTable, TemporalFilter, TrainedWith};
use rayon::prelude::*;

/// Runs and layers of fewer Gaussians become part of others: a file costs more than they do.
pub(crate) const LEAST: usize = 256;
/// The same for runs of packed Gaussians, which are a tenth of the bytes. Small first layers make the first picture soon.
pub(crate) const LEAST_PACKED: usize = 2048;

/// Returns the parts of a capture of `stretches` stretches of time: by first stretch, the shorter before the longer;
/// those of the same stretches by layer. Runs have at least `least` Gaussians.
pub(crate) fn parts(
    gaussians: &[Gaussian],
    lives: &[[u32; 2]],
    stretches: u32,
    shares: &LayerShares,
    least: usize,
) -> Vec<Part> {
    let importances: Vec<f32> = gaussians.par_iter().map(importance).collect();
    runs(lives.iter().copied(), stretches, least)
        .into_iter()
        .flat_map(|run| {
            let part = move |(layer, gaussians)| Part { stretches: run.chunks, layer, gaussians };
            (0..).zip(layers(&run.gaussians, &importances, shares, LEAST)).map(part)
        })
        .collect()
}

/// Returns the importance of a Gaussian for pictures; 0 if it is not a number.
pub(super) fn importance(gaussian: &Gaussian) -> f32 {
    let importance = gaussian.importance();
    if importance.is_nan() { 0.0 } else { importance }
}

/// Returns the first and the last stretch of time in which each Gaussian may be drawn: by the filter, else by its
/// lifespan.
pub(crate) fn lives(
    gaussians: &[Gaussian],
    filter: Option<&TemporalFilter>,
    trained_with: &TrainedWith,
    stretches: u32,
) -> Vec<[u32; 2]> {
    let support = || {
        let (interval, cutoff) = (trained_with.time_interval, trained_with.marginal_cutoff);
        TemporalFilter::support(gaussians.iter().copied(), interval, cutoff, stretches)
    };
    let filter = filter.cloned().unwrap_or_else(support);
    let words = intervals(&filter).unwrap_or_else(|| hulls(&filter));
    let life = |word: &u32| {
        let (first, last) = (word & 0xffff, word >> 16);
        // Of Gaussians that are never drawn, the last segment is the one at which they would be.
        ChunkTable::stretches_of([first.min(last), last], filter.segments, stretches)
    };
    words.iter().map(life).collect()
}
