//! Repairs between steps: births where several cameras of a moment see an error, and the removal of floaters.
//!
//! In: a run with several cameras of the same moments. Out: [`Repairs`], which after some steps draws all views of a
//! few moments, one moment after the other in the order of time, and lets the trainer replace its faintest Gaussians by
//! those that are missing; and which hides the Gaussians that hang before single cameras. What is done after a step
//! follows from the number of the step and from the parameters, so that a resumed run ends as one that was not
//! interrupted. The rules are in the [CPU references](crate::offline::train::reference).

use super::evaluation::{behind, color_behind};
use super::session::Session;
use crate::offline::dataset::selection::{camera_numbers, distance_of_moments};
use crate::offline::dataset::{DatasetError, TrainingView};
use crate::offline::train::densification::{Births, Floaters};
use crate::offline::train::error::TrainError;
use crate::offline::train::reference::births::{births, take_over};
use crate::offline::train::reference::error_peaks::error_peaks;
use crate::offline::train::reference::exposure::{Exposure, exposed};
use crate::offline::train::reference::floaters::{HIDDEN, floaters};
use crate::offline::train::reference::triangulation::{Sight, Sighted, triangulate};
use crate::offline::train::schedule::relocation_seed;
use crate::offline::train::start::region::Region;
use crate::view::{Picture, View};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashSet;
use std::mem::take;

/// Least number of cameras of a moment.
const FEWEST: usize = 3;
/// Largest difference of two times of one moment, in distances of moments.
const SAME: f32 = 0.1;
/// Half the side of the cube in which points are found, in those of the cube that the cameras look at.
const WIDER: f32 = 2.0;
/// Views that are drawn before their errors are searched on all cores.
const AT_ONCE: usize = 8;

/// The repairs of a run.
#[derive(Debug)]
pub(super) struct Repairs {
    births: Option<Births>,
    floaters: Option<Floaters>,
    seed: u64,
    moments: Moments,
    /// The index of a view of each camera that the moments have.
    rig: Vec<usize>,
    /// The cube that the cameras look at; `None` if they look away from each other.
    region: Option<Region>,
    /// Numbers of Gaussians since the last report.
    born: usize,
    hidden: usize,
}

impl Repairs {
    /// Returns the repairs that the settings of a run ask for and that its views allow.
    pub(super) fn of(session: &Session<'_>) -> Self {
        let (growth, views) = (session.settings.growth, &session.images.views);
        let mut repairs = Self {
            births: growth.and_then(|growth| growth.births),
            floaters: growth.and_then(|growth| growth.floaters),
            seed: session.settings.seed,
            moments: Moments::default(),
            rig: Vec::new(),
            region: None,
            born: 0,
            hidden: 0,
        };
        if repairs.births.is_some() || repairs.floaters.is_some() {
            repairs.moments = Moments::of(views);
            repairs.region = Region::of(session.images.all_views()).ok();
            repairs.rig = repairs.moments.rig();
        }
        repairs
    }

    /// Makes the repairs that are due after this number of steps.
    pub(super) fn after_step(&mut self, session: &mut Session<'_>, steps: usize) -> Result<(), TrainError> {
        if self.moments.own.is_empty() {
            return Ok(());
        }
        if self.floaters.is_some_and(|floaters| floaters.is_due_after(steps)) {
            self.hide(session)?;
        }
        match self.births {
            Some(births) if births.is_due_after(steps) => self.bear(session, &births, steps),
            _ => Ok(()),
        }
    }

    /// Returns what has been done since the last report, in words that follow others; nothing if nothing is asked for.
    pub(super) fn report(&mut self) -> String {
        let (born, hidden) = (take(&mut self.born), take(&mut self.hidden));
        let births = self.births.map_or(String::new(), |_| format!(", {born} born"));
        let floaters = self.floaters.map_or(String::new(), |_| format!(", {hidden} floaters hidden"));
        births + &floaters
    }

    /// Hides the Gaussians that hang before single cameras.
    fn hide(&mut self, session: &Session<'_>) -> Result<(), TrainError> {
        let Some(Region { center, .. }) = self.region else { return Ok(()) };
        // At the size of the images at this step, which a resumed run has too.
        let rig: Vec<View> = self.rig.iter().map(|&index| session.images.shots[index].view).collect();
        let mut records = session.trainer.records()?;
        let found = floaters(&records, &rig, center);
        if !found.is_empty() {
            session.trainer.hide(&mut records, &found, HIDDEN);
        }
        self.hidden += found.len();
        Ok(())
    }

    /// Lets Gaussians be born where the views of some moments show that something is missing.
    fn bear(&mut self, session: &mut Session<'_>, asked: &Births, steps: usize) -> Result<(), TrainError> {
        let exposures = session.trainer.exposures()?;
        let mut found = Vec::new();
        for moment in self.moments.of_repair(asked.number(steps), asked.moments_of(self.moments.own.len())) {
            found.push((moment.time, self.missing(session, moment, &exposures)?));
        }
        let births = births(&found, self.moments.distance, asked.most);
        if births.is_empty() {
            return Ok(());
        }
        // Another sequence than that of a relocation after the same step.
        let seed = relocation_seed(self.seed.wrapping_add(1), steps);
        let mut records = session.trainer.records()?;
        let born = take_over(&records, &births, seed);
        session.trainer.replace(&mut records, &born);
        self.born += born.len();
        Ok(())
    }

    /// Returns the points at which several views of a moment show something that the scene lacks.
    fn missing(
        &self,
        session: &mut Session<'_>,
        moment: &Moment,
        exposures: &[Exposure],
    ) -> Result<Vec<Sighted>, TrainError> {
        let Session { trainer, images, background, .. } = session;
        let (images, background) = (&**images, *background);
        let mut sights = Vec::with_capacity(moment.views.len());
        for some in moment.views.chunks(AT_ONCE) {
            let mut drawn = Vec::with_capacity(some.len());
            for &index in some {
                let view = images.shots[index].view;
                let frame = trainer.draw(&view, background)?;
                let exposure = exposures.get(self.moments.cameras[index] as usize);
                let picture = exposure.map(|exposure| exposed(&frame, exposure, color_behind(background)));
                drawn.push((index, view, picture.unwrap_or(frame.picture).clamped()));
            }
            let sight = |(index, view, drawn): &(usize, View, Picture)| -> Result<Sight, DatasetError> {
                let image = images.image(*index)?.over(behind(background));
                Ok(Sight { view: *view, peaks: error_peaks(drawn, &image) })
            };
            for sight in drawn.par_iter().map(sight).collect::<Vec<_>>() {
                sights.push(sight?);
            }
        }
        let (center, reach) = match self.region {
            Some(Region { center, half }) => (center, WIDER * half),
            None => (Vec3::ZERO, f32::INFINITY),
        };
        Ok(triangulate(&sights, center, reach))
    }
}

/// The moments that enough cameras see.
#[derive(Debug, Default, PartialEq)]
struct Moments {
    /// In the order of their times.
    own: Vec<Moment>,
    /// Distance between two moments.
    distance: f32,
    /// The number of the camera of each view.
    cameras: Vec<u32>,
}

/// The views of a moment.
#[derive(Debug, PartialEq)]
struct Moment {
    time: f32,
    /// Indices of its views.
    views: Vec<usize>,
}

impl Moments {
    /// Returns the moments of views. Times that differ by less than a tenth of the distance between two moments are of
    /// one moment.
    fn of(views: &[TrainingView]) -> Self {
        let cameras = camera_numbers(views);
        let distance = distance_of_moments(views, &cameras);
        let mut order: Vec<usize> = (0..views.len()).collect();
        order.sort_by(|&a, &b| views[a].time.total_cmp(&views[b].time));
        let mut own: Vec<Moment> = Vec::new();
        for index in order {
            let time = views[index].time;
            match own.last_mut().filter(|moment| time - moment.time <= SAME * distance) {
                Some(moment) => moment.views.push(index),
                None => own.push(Moment { time, views: vec![index] }),
            }
        }
        let seen_by = |moment: &Moment| moment.views.iter().map(|&index| cameras[index]).collect::<HashSet<_>>().len();
        own.retain(|moment| seen_by(moment) >= FEWEST);
        Self { own, distance, cameras }
    }

    /// Returns the index of a view of each camera.
    fn rig(&self) -> Vec<usize> {
        let mut seen = HashSet::new();
        let indices = self.own.iter().flat_map(|moment| &moment.views).copied();
        indices.filter(|&index| seen.insert(self.cameras[index])).collect()
    }

    /// Returns so many moments one after the other, in the order of time, for the repair of this number, from 0: after
    /// the last moment the first comes again.
    fn of_repair(&self, number: usize, wanted: usize) -> impl Iterator<Item = &Moment> {
        let wanted = wanted.max(1);
        let rounds = self.own.len().div_ceil(wanted).max(1);
        self.own.iter().skip(number % rounds * wanted).take(wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Camera;
    use glam::{Mat4, UVec2};

    /// Returns views of these cameras and times.
    fn views(of: impl Iterator<Item = (usize, f32)>) -> Vec<TrainingView> {
        let view = |(camera, time): (usize, f32)| TrainingView {
            name: String::new(),
            camera: Camera {
                world_to_camera: Mat4::from_translation(Vec3::X * camera as f32),
                size: UVec2::splat(8),
                lens: Camera::fov_lens(0.7, UVec2::splat(8)),
            },
            time,
            original: UVec2::splat(8),
            image: "none.png".into(),
            mask: None,
            correction: Default::default(),
        };
        of.map(view).collect()
    }

    #[test]
    fn moments_are_those_that_three_cameras_see() {
        // Four cameras at five moments, nearly at the same time; the last moment has two views.
        let all = (0..19).map(|index| (index % 4, (index / 4) as f32 * 0.25 + (index % 4) as f32 * 0.005));
        let found = Moments::of(&views(all.filter(|(camera, time)| *camera < 2 || *time < 0.9)));
        assert_eq!(found.own.len(), 4, "{found:?}");
        assert!((found.distance - 0.25).abs() < 1e-4, "{}", found.distance);
        assert!(found.own.iter().all(|moment| moment.views.len() == 4), "the views of all cameras: {found:?}");
        assert_eq!(found.rig(), [0, 1, 2, 3], "a view of each camera");
        let firsts: Vec<f32> = (0..4).flat_map(|repair| found.of_repair(repair, 3)).map(|moment| moment.time).collect();
        assert_eq!(firsts, [0.0, 0.25, 0.5, 0.75, 0.0, 0.25, 0.5, 0.75], "one repair after the other");
        let one = Moments::of(&views((0..9).map(|camera| (camera, 0.5))));
        assert_eq!((one.own.len(), one.distance), (1, 1.0), "all at one moment");
        assert_eq!(one.of_repair(7, 3).count(), 1, "which is all that there is");
        let moving = Moments::of(&views((0..9).map(|index| (index, index as f32))));
        assert_eq!((moving.own.len(), moving.distance), (0, 1.0), "a camera that moves sees each moment alone");
    }
}
