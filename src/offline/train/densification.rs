//! When Gaussians are relocated, cloned, split and removed in training from pictures alone, and what comes with it.
//!
//! In: the number of steps. Out: [`Growth`]: the steps after which Gaussians are relocated, the strength of the noise,
//! the share that is hidden, how the rate of means falls, when the degrees of color rise; [`Cloning`]: the steps after
//! which Gaussians are cloned, split and removed as in the original; [`Births`] and [`Floaters`]: the steps after which
//! what several cameras miss is added, and what hangs before single cameras is hidden. What happens then is in the
//! [CPU references](super::reference).

use crate::gaussian::harmonics::evaluated;

/// Largest spatial degree of color.
const DEGREE: usize = 3;
/// Largest degree of color in time.
const DEGREE_T: usize = 2;

/// Relocation, noise and schedules of training from pictures alone. The number of Gaussians is fixed, as in 3DGS-MCMC,
/// where relocation and noise take the place of cloning, splitting and resets of opacity: a training with a budget does
/// not first make the short-lived Gaussians that pruning then removes (4DGS-1K).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    /// Steps between two relocations of the Gaussians that have faded; `None`: none is relocated. Default: 100, as in
    /// 3DGS-MCMC.
    pub relocate_every: Option<usize>,
    /// The first step after which Gaussians are relocated. Default: 500, and at most a twentieth of all: before,
    /// opacities are those of the start.
    pub relocate_from: usize,
    /// The last such step. Default: five sixths of all: what is relocated needs steps to find its shape.
    pub relocate_until: usize,
    /// Factor on the rate of means that gives the strength of the noise. Default: 2.5e5, half that of 3DGS-MCMC; 0
    /// moves nothing.
    pub noise: f64,
    /// Factor on the rate of means at the last step, to which it falls exponentially, beside the other factors.
    /// Default: 0.01, as in 3DGS.
    pub last_mean_rate: f64,
    /// Steps between two rises of a degree of color: the spatial degree from 0 to 3, then the degree in time. Default:
    /// 1000, as in the original 4DGS, and at most a twentieth of all.
    pub raise_every: usize,
    /// Share of the Gaussians, drawn anew for each step, that its views are drawn without, until
    /// [`relocate_until`](Self::relocate_until). Default: 0.1.
    pub dropout: f64,
    /// Least temporal scale of a Gaussian, as a share of the interval. Default: 0, any.
    pub least_time_scale: f64,
    /// The densification of the original, in place of relocation; `None`, the default: the number of Gaussians stays.
    pub cloning: Option<Cloning>,
    /// Births of Gaussians where several cameras of a moment see an error; `None`, the default: there are none.
    pub births: Option<Births>,
    /// Removal of Gaussians that hang before single cameras; `None`, the default: they stay.
    pub floaters: Option<Floaters>,
}

/// Births of Gaussians where several cameras of one moment see that something is missing: small things that move fast
/// are lost by all other changes, which begin with Gaussians that are there. They need at least three cameras at the
/// same moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Births {
    /// Steps between two searches. Default: 500, and at most a twentieth of all.
    pub every: usize,
    /// The first step after which there is one. Default: a twentieth of all.
    pub from: usize,
    /// The last such step. Default: seven tenths of all.
    pub until: usize,
    /// Least number of moments of a search, one after the other; the next search continues after them. There are more
    /// if all searches together would not reach the last moment. Default: 3.
    pub moments: usize,
    /// Most births of a search, each of three Gaussians. Default: 200.
    pub most: usize,
}

/// Removal of Gaussians that are close before a camera and seen by few: they are hidden, and relocated or removed as
/// others that have faded. It needs at least three cameras at the same moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Floaters {
    /// Steps between two searches. Default: 1000, and at most a tenth of all.
    pub every: usize,
    /// The first step after which there is one. Default: a tenth of all.
    pub from: usize,
    /// The last such step. Default: five sixths of all, as that of relocation.
    pub until: usize,
}

/// The densification of the original 4DGS, within a fixed number of places: Gaussians with large gradients on the
/// screen are cloned or split, since what they cover needs more than one Gaussian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cloning {
    /// Most Gaussians.
    pub capacity: usize,
    /// Steps between two densifications.
    pub every: usize,
    /// The step after which they begin.
    pub from: usize,
    /// The step before which they and the resets of opacity end.
    pub until: usize,
    /// Steps between two resets of opacity: Gaussians that the images do not need fade after one, and are removed.
    /// After the first, large Gaussians are removed.
    pub reset_every: usize,
}

impl Growth {
    /// Returns the defaults for this number of steps.
    pub fn over(steps: usize) -> Self {
        Self {
            relocate_every: Some(100),
            relocate_from: 500.min(steps / 20),
            relocate_until: steps / 6 * 5,
            noise: 2.5e5,
            last_mean_rate: 0.01,
            raise_every: 1000.min(steps / 20).max(1),
            dropout: 0.1,
            least_time_scale: 0.0,
            cloning: None,
            births: None,
            floaters: None,
        }
    }

    /// Returns the densification of the original over this number of steps, up to `capacity` Gaussians: without
    /// relocation, noise and dropout.
    pub(crate) fn original(steps: usize, capacity: usize) -> Self {
        let cloning = Some(Cloning::over(steps, capacity));
        Self { relocate_every: None, noise: 0.0, dropout: 0.0, cloning, ..Self::over(steps) }
    }

    /// Returns whether Gaussians are relocated after this number of steps.
    pub(crate) fn relocates_after(&self, step: usize) -> bool {
        let every = self.relocate_every.is_some_and(|every| step.is_multiple_of(every.max(1)));
        every && (self.relocate_from..=self.relocate_until).contains(&step)
    }

    /// Returns the share of the Gaussians that the views of a step are drawn without.
    pub(crate) fn dropout(&self, step: usize) -> f64 {
        if step < self.relocate_until { self.dropout } else { 0.0 }
    }

    /// Returns the factor on the rate of means at a step of `steps`.
    pub(crate) fn mean_rate(&self, step: usize, steps: usize) -> f64 {
        self.last_mean_rate.powf((step as f64 / steps.max(1) as f64).min(1.0))
    }

    /// Returns the number of values of the color of each Gaussian that are trained at a step.
    pub(crate) fn color_values(&self, step: usize) -> u32 {
        let rises = step / self.raise_every.max(1);
        let degree = rises.min(DEGREE);
        3 * evaluated(degree as u32, (rises - degree).min(DEGREE_T) as u32) as u32
    }
}

impl Births {
    /// Returns the defaults for this number of steps.
    pub fn over(steps: usize) -> Self {
        Self { every: 500.min(steps / 20).max(1), from: steps / 20, until: steps / 10 * 7, moments: 3, most: 200 }
    }

    /// Returns whether there is a search after this number of steps.
    pub(crate) fn is_due_after(&self, step: usize) -> bool {
        step > 0 && step.is_multiple_of(self.every.max(1)) && (self.from..=self.until).contains(&step)
    }

    /// Returns the number of moments of each search, if there are so many in all.
    pub(crate) fn moments_of(&self, all: usize) -> usize {
        let searches = self.number(self.until) + 1;
        self.moments.max(all.div_ceil(searches))
    }

    /// Returns the number of the search after this number of steps, from 0.
    pub(crate) fn number(&self, step: usize) -> usize {
        let every = self.every.max(1);
        (step / every).saturating_sub(self.from.max(1).div_ceil(every))
    }
}

impl Floaters {
    /// Returns the defaults for this number of steps.
    pub fn over(steps: usize) -> Self {
        Self { every: 1000.min(steps / 10).max(1), from: steps / 10, until: steps / 6 * 5 }
    }

    /// Returns whether there is a search after this number of steps.
    pub(crate) fn is_due_after(&self, step: usize) -> bool {
        step > 0 && step.is_multiple_of(self.every.max(1)) && (self.from..=self.until).contains(&step)
    }
}

impl Cloning {
    /// Returns the schedule of the original, whose 30,000 steps are scaled down to fewer, and not up to more.
    fn over(steps: usize, capacity: usize) -> Self {
        let reset_every = 3000.min(steps / 10).max(1);
        Self { capacity, every: 100, from: 500.min(steps / 60), until: 15_000.min(steps / 2), reset_every }
    }

    /// Returns the number of Gaussians before the first step, which is a quarter of the capacity.
    pub(crate) fn first(capacity: usize) -> usize {
        capacity.div_ceil(4)
    }

    /// Returns whether gradients are added up in a step.
    pub(crate) fn adds_up(&self, step: usize) -> bool {
        step < self.until
    }

    /// Returns whether Gaussians are cloned, split and removed after this number of steps.
    pub(crate) fn densifies_after(&self, step: usize) -> bool {
        step.is_multiple_of(self.every.max(1)) && self.from < step && step < self.until
    }

    /// Returns whether large Gaussians are removed after this number of steps.
    pub(crate) fn removes_large_after(&self, step: usize) -> bool {
        step > self.reset_every
    }

    /// Returns whether opacities are reset after this number of steps.
    pub(crate) fn resets_after(&self, step: usize) -> bool {
        step.is_multiple_of(self.reset_every.max(1)) && step < self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_of_color_rise_one_after_the_other() {
        let growth = Growth { raise_every: 10, ..Growth::over(1000) };
        let values = [0, 9, 10, 20, 30, 40, 50, 999].map(|step| growth.color_values(step));
        assert_eq!(values, [3, 3, 12, 27, 48, 96, 144, 144], "degrees 0 to 3, then 1 and 2 in time, three channels");
    }

    #[test]
    fn relocation_has_a_first_and_a_last_step() {
        let growth = Growth::over(12_000);
        let steps: Vec<usize> = (0..12_000).filter(|&step| growth.relocates_after(step)).collect();
        assert_eq!((steps.first(), steps.last(), steps.len()), (Some(&500), Some(&10_000), 96), "every hundred steps");
        let never = Growth { relocate_every: None, ..growth };
        assert!(!(0..12_000).any(|step| never.relocates_after(step)), "or never");
    }

    #[test]
    fn searches_are_numbered_from_the_first() {
        let births = Births::over(20_000);
        let steps: Vec<usize> = (0..=20_000).filter(|&step| births.is_due_after(step)).collect();
        assert_eq!((steps.first(), steps.last(), steps.len()), (Some(&1000), Some(&14_000), 27), "of births");
        let numbers: Vec<usize> = steps.into_iter().map(|step| births.number(step)).collect();
        assert_eq!(numbers, (0..27).collect::<Vec<_>>(), "one after the other");
        let floaters = Floaters::over(20_000);
        let steps: Vec<usize> = (0..=20_000).filter(|&step| floaters.is_due_after(step)).collect();
        assert_eq!((steps.first(), steps.last(), steps.len()), (Some(&2000), Some(&16_000), 15), "of floaters");
        let often = Births { every: 1, from: 0, ..births };
        assert!(!often.is_due_after(0) && often.is_due_after(1) && often.number(1) == 0, "none before a step");
    }

    #[test]
    fn the_original_densifies_in_the_first_half() {
        let cloning = Cloning::over(30_000, 9);
        let steps =
            |is_due: &dyn Fn(usize) -> bool| -> Vec<usize> { (1..30_000).filter(|&step| is_due(step)).collect() };
        let dense = steps(&|step| cloning.densifies_after(step));
        assert_eq!((dense.first(), dense.last(), dense.len()), (Some(&600), Some(&14_900), 144), "every hundred steps");
        let resets = steps(&|step| cloning.resets_after(step));
        assert_eq!(resets, [3000, 6000, 9000, 12_000], "every three thousand");
        let large = [3000, 3001].map(|step| cloning.removes_large_after(step));
        assert_eq!(large, [false, true], "large ones after the first reset");
        let short = Cloning::over(600, 9);
        assert_eq!(
            (short.from, short.until, short.reset_every),
            (10, 300, 60),
            "in proportion if there are fewer steps"
        );
    }

    #[test]
    fn the_rate_of_means_falls_exponentially() {
        let growth = Growth::over(100);
        assert_eq!(growth.mean_rate(0, 100), 1.0, "at first");
        assert!((growth.mean_rate(50, 100) - 0.1).abs() < 1e-12, "halfway the root of the last factor");
        assert!((growth.mean_rate(300, 100) - 0.01).abs() < 1e-12, "at the end, and after it");
    }
}
