//! Searches: the hits of each ray, found in the background for large captures.
//!
//! In: in each frame, the captures whose boxes a ray meets. Out: the hits of the newest finished search of the ray.
//!
//! A search visits every Gaussian, so its time must not be part of a frame. Small captures are searched at once; large
//! ones in Bevy's `AsyncComputeTaskPool`, one search per ray at a time, always of the newest ray: the hits are then
//! those of a ray some frames ago. While neither the pointer nor a capture under it has changed, nothing is searched.

use crate::plugin::picker::{Aim, CaptureHit};
use bevy::ecs::resource::Resource;
use bevy::ecs::system::Res;
use bevy::picking::backend::ray::RayId;
use bevy::platform::collections::HashMap;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};

/// Most Gaussians, in all captures whose boxes a ray meets, that are searched at once: a fraction of a millisecond.
const AT_ONCE: usize = 1 << 14;

/// The searches of all rays.
#[derive(Resource, Default)]
pub(super) struct Searches(HashMap<RayId, Search>);

/// The searches of one ray.
#[derive(Default)]
struct Search {
    /// The newest finished search, and its hits.
    finished: (Vec<Aim>, Vec<CaptureHit>),
    /// The search that runs in the background.
    running: Option<(Vec<Aim>, Task<Vec<CaptureHit>>)>,
}

/// Returns whether there is state of a ray.
pub(super) fn any_search(searches: Res<Searches>) -> bool {
    !searches.0.is_empty()
}

impl Searches {
    /// Drops the searches of rays that no longer exist.
    pub(super) fn retain(&mut self, exists: impl Fn(&RayId) -> bool) {
        self.0.retain(|ray, _| exists(ray));
    }

    /// Returns the hits of a ray, nearest first, for the captures whose boxes it meets in this frame.
    pub(super) fn hits(&mut self, ray: RayId, aims: Vec<Aim>) -> Vec<CaptureHit> {
        self.0.entry(ray).or_default().hits(aims)
    }
}

impl Search {
    fn hits(&mut self, aims: Vec<Aim>) -> Vec<CaptureHit> {
        if let Some((searched, task)) = &mut self.running
            && let Some(hits) = check_ready(task)
        {
            self.finished = (std::mem::take(searched), hits);
            self.running = None;
        }
        if self.finished.0 != aims {
            if aims.iter().map(Aim::count).sum::<usize>() <= AT_ONCE {
                // The result of a search in the background would be older.
                self.running = None;
                let hits = Aim::cast_all(&aims);
                self.finished = (aims, hits);
                return self.finished.1.clone();
            }
            if self.running.is_none() {
                let searched = aims.clone();
                let task = AsyncComputeTaskPool::get().spawn(async move { Aim::cast_all(&searched) });
                self.running = Some((aims.clone(), task));
            }
        }
        // Captures that have been removed, hidden or left by the ray since are not hit.
        let is_met = |hit: &&CaptureHit| aims.iter().any(|aim| aim.entity() == hit.entity);
        self.finished.1.iter().filter(is_met).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::picker::aim_at;
    use bevy::ecs::entity::Entity;
    use bevy::tasks::TaskPool;
    use std::time::{Duration, Instant};

    fn entity(number: u32) -> Entity {
        Entity::from_raw_u32(number).expect("a small number")
    }

    /// Searches until the search in the background has finished, and returns its hits.
    fn finish(search: &mut Search, aims: &[Aim]) -> Vec<CaptureHit> {
        let start = Instant::now();
        loop {
            let hits = search.hits(aims.to_vec());
            if search.running.is_none() {
                return hits;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "a search ends within 60 s");
            std::thread::yield_now();
        }
    }

    #[test]
    fn small_captures_are_searched_at_once() {
        let mut search = Search::default();
        let aims = vec![aim_at(entity(1), AT_ONCE, 0.0)];
        let hits = search.hits(aims.clone());
        assert_eq!(hits.first().map(|hit| hit.entity), Some(entity(1)), "the capture is hit in the same frame");
        assert!(search.running.is_none(), "no search runs in the background");
        assert_eq!(search.hits(aims), hits, "the next frame has the same hits");
    }

    #[test]
    fn large_captures_are_searched_in_the_background_and_only_after_a_change() {
        AsyncComputeTaskPool::get_or_init(TaskPool::new);
        let mut search = Search::default();
        let aims = vec![aim_at(entity(1), AT_ONCE + 1, 0.0)];
        assert_eq!(search.hits(aims.clone()), [], "the first frame does not wait for the search");
        assert!(search.running.is_some(), "a search runs in the background");
        let hits = finish(&mut search, &aims);
        assert_eq!(hits.first().map(|hit| hit.entity), Some(entity(1)), "a later frame has the hit");
        assert_eq!(search.hits(aims.clone()), hits, "the hit is repeated in every frame");
        assert!(search.running.is_none(), "an unchanged ray is not searched again");
        let other = vec![aim_at(entity(1), AT_ONCE + 1, 1.0)];
        assert_eq!(search.hits(other.clone()), hits, "the last hit is kept while another search runs");
        assert!(search.running.is_some(), "a changed capture is searched again");
        assert_eq!(search.hits(Vec::new()), [], "a capture that the ray has left is not hit");
        assert!(search.running.is_none(), "its search is dropped");
    }
}
