//! Visibility masks: the Gaussians that views blend at each key-frame, and in each segment of time between two.
//!
//! In: key-frames, cameras, views, a [`ScoreEngine`], a shard. Out: the [`VisibilityMasks`] of the shard; of all shards
//! their union, and the temporal filter of these masks.

use crate::offline::score::{ScoreEngine, ScoreError, Want};
use crate::offline::store::shard::Shard;
use crate::offline::work::{Progress, proceed};
use crate::scene::filter::segment_of;
use crate::scene::{FilterKind, TemporalFilter};
use crate::view::{Camera, Optics, View};

/// A set of Gaussians: Gaussian `i` at bit `i % 32` of word `i / 32`.
pub type Mask = Vec<u32>;

/// A view whose Gaussians are added to a mask.
#[derive(Debug, Clone, Copy)]
pub struct MaskView {
    view: View,
    /// Index of the mask: those of the key-frames come first, then those of the segments.
    mask: usize,
}

/// Returns the views of every camera at each key-frame, with the optics of the capture, then `views`, each for the
/// segment of its time. `interval` is the time interval, which the key-frames divide evenly.
pub fn mask_views(
    key_frames: &[f32],
    cameras: &[Camera],
    views: &[View],
    optics: impl Into<Optics>,
    interval: [f32; 2],
) -> Vec<MaskView> {
    let (keys, optics) = (key_frames.len(), optics.into());
    let segments = u32::try_from(keys.saturating_sub(1)).unwrap_or(u32::MAX);
    let at_keys = key_frames
        .iter()
        .enumerate()
        .flat_map(|(mask, &time)| cameras.iter().map(move |camera| MaskView { view: camera.view(time, optics), mask }));
    let between =
        views.iter().map(|&view| MaskView { view, mask: keys + segment_of(view.time, interval, segments) as usize });
    at_keys.chain(between).collect()
}

/// The Gaussians that are blended into at least one pixel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VisibilityMasks {
    /// By a camera at each key-frame.
    pub key_frames: Vec<Mask>,
    /// By a view in each segment between two key-frames.
    between: Vec<Mask>,
    /// Number of Gaussians.
    count: usize,
}

impl VisibilityMasks {
    /// Scores the views of a shard. `keys` is the number of key-frames, at least two, and `count` that of Gaussians.
    /// Begins the task "looking".
    ///
    /// # Errors
    /// No views at all, a failure of the engine.
    pub fn of_shard(
        engine: &mut dyn ScoreEngine,
        views: &[MaskView],
        keys: usize,
        count: usize,
        shard: Shard,
        progress: &mut dyn Progress,
    ) -> Result<Self, ScoreError> {
        if views.is_empty() {
            return Err(ScoreError::NoViews);
        }
        let empty = |number: usize| vec![vec![0; TemporalFilter::words(count)]; number];
        let mut masks = Self { key_frames: empty(keys), between: empty(keys.saturating_sub(1)), count };
        let share = shard.share(&vec![1; views.len()]);
        progress.begin("looking", share.len());
        for MaskView { view, mask } in share.into_iter().filter_map(|index| views.get(index)) {
            proceed(progress)?;
            if let Some(mask) = masks.key_frames.iter_mut().chain(&mut masks.between).nth(*mask) {
                add_blended(engine, view, mask)?;
            }
            progress.advance();
        }
        progress.finish();
        Ok(masks)
    }

    /// Adds the masks of another shard with the same inputs.
    pub(crate) fn merge(&mut self, other: &Self) {
        let ours = self.key_frames.iter_mut().chain(&mut self.between).flatten();
        let theirs = other.key_frames.iter().chain(&other.between).flatten();
        ours.zip(theirs).for_each(|(word, other)| *word |= other);
    }

    /// Returns the filter of these masks, which are those of all shards: in each segment, the union of the masks at its
    /// two ends, as in the paper, and for [`FilterKind::Interval`] also the mask of the segment.
    ///
    /// # Errors
    /// The cameras show nothing of the scene at any of the key-frames.
    pub fn filter(&self, kind: FilterKind) -> Result<TemporalFilter, ScoreError> {
        if self.key_frames.iter().flatten().all(|&word| word == 0) {
            return Err(ScoreError::NothingContributes);
        }
        let ends = self.key_frames.iter().zip(self.key_frames.iter().skip(1));
        let is_between = kind == FilterKind::Interval;
        let words = ends.zip(&self.between).flat_map(|((first, last), between)| {
            let words = first.iter().zip(last).zip(between);
            words.map(move |((first, last), between)| first | last | if is_between { *between } else { 0 })
        });
        Ok(TemporalFilter::from_bits(kind, self.between.len() as u32, self.count, words.collect()))
    }

    /// Returns the words of all masks.
    pub(crate) fn to_words(&self) -> Vec<u32> {
        self.key_frames.iter().chain(&self.between).flatten().copied().collect()
    }

    /// Returns the number of words of the masks of `count` Gaussians with `keys` key-frames.
    pub(crate) fn words(keys: usize, count: usize) -> usize {
        (2 * keys).saturating_sub(1).saturating_mul(TemporalFilter::words(count))
    }

    /// Returns the masks of [`to_words`](Self::to_words); `None` if the words are of another scene or other key-frames.
    pub(crate) fn of_words(words: &[u32], keys: usize, count: usize) -> Option<Self> {
        if words.len() != Self::words(keys, count) {
            return None;
        }
        let mut masks = words.chunks(TemporalFilter::words(count).max(1)).map(<[u32]>::to_vec);
        let key_frames: Vec<Mask> = masks.by_ref().take(keys).collect();
        Some(Self { key_frames, between: masks.collect(), count })
    }
}

/// Adds the Gaussians that the view blends into at least one pixel to a mask.
fn add_blended(engine: &mut dyn ScoreEngine, view: &View, mask: &mut [u32]) -> Result<(), ScoreError> {
    let score = engine.score(view, Want::Contribution)?;
    for (word, values) in mask.iter_mut().zip(score.contribution.chunks(32)) {
        for (bit, &contribution) in values.iter().enumerate() {
            *word |= u32::from(contribution > 0.0) << bit;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn masks(key_frames: [u32; 3], between: [u32; 2]) -> VisibilityMasks {
        let of_words = |words: &[u32]| words.iter().map(|&word| vec![word]).collect();
        VisibilityMasks { key_frames: of_words(&key_frames), between: of_words(&between), count: 5 }
    }

    #[test]
    fn a_segment_has_the_union_of_the_masks_at_its_ends() {
        let masks = masks([0b0001, 0b0110, 0b0100], [0b1000, 0b1_0000]);
        let filter = masks.filter(FilterKind::KeyFrame).expect("Gaussians are visible");
        assert_eq!(filter.segments, 2, "one segment less than key-frames");
        assert_eq!(filter.to_bits(), [0b0111, 0b0110], "unions of neighboring masks");
        let filter = masks.filter(FilterKind::Interval).expect("Gaussians are visible");
        assert_eq!(filter.to_bits(), [0b1111, 0b1_0110], "and of the Gaussians visible between");
    }

    #[test]
    fn merged_masks_are_those_of_all_views() {
        let mut merged = masks([1, 0, 0], [0, 2]);
        merged.merge(&masks([0, 4, 0], [8, 0]));
        assert_eq!(merged, masks([1, 4, 0], [8, 2]), "unions");
        assert_eq!(VisibilityMasks::of_words(&merged.to_words(), 3, 5), Some(merged.clone()), "words and back");
        assert_eq!(VisibilityMasks::of_words(&merged.to_words(), 3, 33), None, "words of another scene");
        let nothing = masks([0; 3], [1; 2]).filter(FilterKind::Interval);
        assert!(matches!(nothing, Err(ScoreError::NothingContributes)), "nothing is visible at key-frames");
    }
}
