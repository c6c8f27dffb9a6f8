//! The views that a step of a deformation sees.
//!
//! In: the times of views, a step. Out: the index of a view. Training begins with views around the middle of time, and reaches one moment after the
//! other from there, so that each has moved little from where the deformation shows the one before.

use crate::scene::random::Random;

/// Views that training begins with: a share of all, and the fewest.
const FIRST: f64 = 0.12;
const FEWEST: usize = 8;
/// Share of the steps after which all views are seen.
const WIDENS: f64 = 0.4;
/// Share of the views in the window that are at its ends, and of the steps that see one of these while it widens.
const ENDS: f64 = 0.15;
const AT_ENDS: f32 = 0.4;

/// The views in the order of time, and how many steps there are.
#[derive(Debug)]
pub(super) struct Window {
    order: Vec<usize>,
    steps: usize,
}

impl Window {
    pub(super) fn new(times: &[f32], steps: usize) -> Self {
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        Self { order, steps }
    }

    /// Returns the views that training begins with.
    pub(super) fn first(&self) -> &[usize] {
        &self.order[self.range(0)]
    }

    /// Returns whether all views are seen at a step, and how far training is since then, 0 to 1.
    pub(super) fn since_all(&self, step: usize) -> Option<f64> {
        let done = step as f64 / self.steps.max(1) as f64;
        (done >= WIDENS).then(|| (done - WIDENS) / (1.0 - WIDENS))
    }

    /// Returns the ranks, by time, of the views in the window of a step.
    fn range(&self, step: usize) -> std::ops::Range<usize> {
        let count = self.order.len();
        let first = (FIRST * count as f64).max(FEWEST as f64).min(count as f64);
        let share = (step as f64 / (WIDENS * self.steps as f64).max(1.0)).min(1.0);
        let wide = (first + (count as f64 - first) * share).round() as usize;
        let begin = (count - wide) / 2;
        begin..begin + wide
    }

    /// Returns the view of a step.
    pub(super) fn view(&self, step: usize, random: &mut Random) -> usize {
        let range = self.range(step);
        let ends = ((ENDS * range.len() as f64) as usize).max(1);
        let at_ends = self.since_all(step).is_none() && random.unit() < AT_ENDS;
        let among = if at_ends { ends } else { range.len() };
        let drawn = random.below(among);
        // Those at the ends are the first half of `ends` and the last.
        let rank = if at_ends && drawn >= ends / 2 { range.len() - ends + drawn } else { drawn };
        self.order[range.start + rank]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_widens_from_the_middle_to_all_views() {
        // In an order that is not that of time.
        let times: Vec<f32> = (0..100).map(|index| ((index * 37) % 100) as f32).collect();
        let window = Window::new(&times, 1000);
        let span = |step: usize| {
            let mut random = Random::new(3);
            let seen: Vec<f32> = (0..4000).map(|_| times[window.view(step, &mut random)]).collect();
            let extreme = |better: fn(f32, f32) -> f32| seen.iter().copied().reduce(better);
            [extreme(f32::min), extreme(f32::max)].map(Option::unwrap_or_default)
        };
        assert_eq!([0, 200, 400, 999].map(span), [[44.0, 55.0], [22.0, 77.0], [0.0, 99.0], [0.0, 99.0]]);
        assert_eq!(window.first().len(), 12, "as many views as the first step can see");
        let mut random = Random::new(5);
        let outer = |step: usize, random: &mut Random| {
            let is_outer = |time: f32| !(28.0..72.0).contains(&time);
            (0..4000).filter(|_| is_outer(times[window.view(step, random)])).count()
        };
        let (widening, later) = (outer(200, &mut random), outer(900, &mut random));
        assert!((1850..2150).contains(&widening), "those at the ends are seen more often: {widening}");
        assert!((2150..2350).contains(&later), "all as often: {later}");
    }

    #[test]
    fn few_views_are_all_seen() {
        let window = Window::new(&[0.5, 0.1, 0.9], 10);
        let mut random = Random::new(1);
        let mut seen = [0; 3];
        (0..10).flat_map(|step| [step; 30]).for_each(|step| seen[window.view(step, &mut random)] += 1);
        assert!(seen.iter().all(|&count| count > 30), "each of three views: {seen:?}");
    }
}
