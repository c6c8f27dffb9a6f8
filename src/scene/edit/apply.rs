//! The application of edits.
//!
//! In: a capture of any form, a list of edits, what the training cameras see if an edit asks for it. Out: [`Edited`]:
//! the capture without the Gaussians that the edits remove, by the rule of the [module](super).

use super::error::EditError;
use super::list::{Edit, EditList};
use super::seen::Seen;
use crate::gaussian::eigen::eigen;
use crate::gaussian::{Gaussian, lifespan_reach};
use crate::scene::{GaussianScene, TemporalFilter, TrainedWith};
use glam::{DMat3, DMat4, Vec3};
use rayon::prelude::*;

/// A capture after its edits.
#[derive(Debug, Clone, PartialEq)]
pub struct Edited {
    /// The capture. The Gaussians that it keeps have their bits and their order. A packed capture also has
    /// [`fillers`](Self::fillers). If a Gaussian is removed, levels of detail are, too: the sizes at which they are
    /// drawn are those of the whole capture.
    pub scene: GaussianScene,
    /// Number of Gaussians that each edit has removed, of those that the edits before it have left.
    pub removed: Vec<usize>,
    /// Number of Gaussians that are kept.
    pub kept: usize,
}

impl Edited {
    /// Returns the number of invisible Gaussians in a packed capture that fill the blocks from which some are removed:
    /// without them, the others would have to be rounded again.
    pub fn fillers(&self) -> usize {
        self.scene.len().saturating_sub(self.kept)
    }
}

/// Applies a list of edits to a capture whose parts fit together ([`GaussianScene::check`]). `seen` is needed by lists
/// that [ask for it](EditList::needs_cameras). If nothing is removed, the capture stays as it is.
///
/// # Errors
/// Edits whose numbers are [wrong](Edit::check), or that leave no visible Gaussian; an edit that needs `seen`; a
/// Gaussian in the trained form that cannot be drawn.
pub fn apply(scene: GaussianScene, list: &EditList, seen: Option<&Seen>) -> Result<Edited, EditError> {
    let (keep, removed) = kept(&scene, list, seen)?;
    let scene = if keep.len() < scene.len() { scene.select(&keep) } else { scene };
    Ok(Edited { scene, removed, kept: keep.len() })
}

/// Returns the indices of the Gaussians that are kept, ascending, and the number that each edit removes.
fn kept(scene: &GaussianScene, list: &EditList, seen: Option<&Seen>) -> Result<(Vec<u32>, Vec<usize>), EditError> {
    let gaussians = scene.gaussians()?;
    let is_visible = |&index: &u32| gaussians[index as usize].opacity > 0.0;
    let mut keep: Vec<u32> = (0..gaussians.len() as u32).collect();
    let mut removed = Vec::with_capacity(list.edits.len());
    for (number, edit) in (1..).zip(&list.edits) {
        edit.check().map_err(|reason| EditError::Wrong { number, name: edit.name(), reason })?;
        if edit.needs_cameras() && seen.is_none() {
            return Err(EditError::NotSeen { number, name: edit.name() });
        }
        let (before, had_visible) = (keep.len(), keep.par_iter().any(is_visible));
        let stays = |&index: &u32| {
            let index = index as usize;
            !removes(edit, index, &gaussians[index], scene, seen)
        };
        keep = keep.into_par_iter().filter(stays).collect();
        // What is left of packed blocks may be their fillers alone.
        if before > 0 && (keep.is_empty() || had_visible && !keep.par_iter().any(is_visible)) {
            return Err(EditError::Everything { number, name: edit.name() });
        }
        removed.push(before - keep.len());
    }
    Ok((keep, removed))
}

/// Returns whether an edit removes a Gaussian.
fn removes(edit: &Edit, index: usize, gaussian: &Gaussian, scene: &GaussianScene, seen: Option<&Seen>) -> bool {
    let place = |times| place(index, gaussian, times, &scene.trained_with, scene.filter.as_ref());
    match *edit {
        Edit::KeepBox { min, max, times } => place(times).is_some_and(|place| !is_in_box(place, min, max)),
        Edit::RemoveBox { min, max, times } => place(times).is_some_and(|place| is_in_box(place, min, max)),
        Edit::KeepSphere { center, radius, times } => {
            place(times).is_some_and(|place| !is_in_sphere(place, center, radius))
        }
        Edit::RemoveSphere { center, radius, times } => {
            place(times).is_some_and(|place| is_in_sphere(place, center, radius))
        }
        Edit::RemoveFaintLarge { opacity_below, scale_above } => {
            // Fillers of packed blocks are invisible already.
            gaussian.opacity > 0.0 && gaussian.opacity < opacity_below && largest_deviation(gaussian) > scale_above
        }
        Edit::RemoveFloaters { cameras_below, distance_below } => {
            seen.is_some_and(|seen| seen.is_floater(index, cameras_below, distance_below))
        }
    }
}

/// Returns where a Gaussian is at the time of a stretch at which it is most opaque; `None` if it does not live in
/// `times`.
fn place(
    index: usize,
    gaussian: &Gaussian,
    times: Option<[f32; 2]>,
    trained_with: &TrainedWith,
    filter: Option<&TemporalFilter>,
) -> Option<Vec3> {
    let [first, last] = life(index, gaussian, trained_with, filter);
    let [first, last] = match times.map(|times| times.map(f64::from)) {
        Some([from, to]) => [first.max(from), last.min(to)],
        // What is never drawn is looked at, too: nothing is left outside of a region to keep.
        None if first > last => trained_with.time_interval.map(f64::from),
        None => [first, last],
    };
    (first <= last).then(|| gaussian.mean_at(f64::from(gaussian.mean_t).clamp(first, last) as f32))
}

/// Returns the first and the last time of the time interval at which a Gaussian may be drawn, timestamp units; the
/// first is after the last if there is none.
pub(crate) fn life(
    index: usize,
    gaussian: &Gaussian,
    trained_with: &TrainedWith,
    filter: Option<&TemporalFilter>,
) -> [f64; 2] {
    let half = lifespan_reach(trained_with.marginal_cutoff) * f64::from(gaussian.sigma_t);
    let [begin, end] = trained_with.time_interval;
    let [mean, begin, end] = [gaussian.mean_t, begin, end].map(f64::from);
    let (mut first, mut last) = (begin.max(mean - half), end.min(mean + half));
    if let Some(filter) = filter {
        let [opens, closes] = filter.window(index, trained_with.time_interval);
        (first, last) = (first.max(opens), last.min(closes));
    }
    [first, last]
}

/// Returns the standard deviation of a Gaussian along its longest axis, capture units.
pub(crate) fn largest_deviation(gaussian: &Gaussian) -> f32 {
    let [xx, xy, xz, yy, yz, zz] = gaussian.covariance.map(f64::from);
    let covariance = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let (variances, _) = eigen(DMat4::from_mat3(covariance));
    variances.truncate().max_element().max(0.0).sqrt() as f32
}

fn is_in_box(place: Vec3, min: [f32; 3], max: [f32; 3]) -> bool {
    place.cmpge(min.into()).all() && place.cmple(max.into()).all()
}

fn is_in_sphere(place: Vec3, center: [f32; 3], radius: f32) -> bool {
    place.distance(center.into()) <= radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{ActiveSets, FilterKind, Form, Packing, RuntimeScene, SceneForm};

    /// Returns a Gaussian at `x`, which moves along y by 1 a unit of time.
    fn gaussian(x: f32, mean_t: f32, sigma_t: f32) -> Gaussian {
        Gaussian {
            mean: [x, 0.0, 0.0],
            mean_t,
            velocity: [0.0, 1.0, 0.0],
            sigma_t,
            covariance: [0.01, 0.0, 0.0, 0.01, 0.0, 0.01],
            opacity: 0.5,
            padding: 0.0,
        }
    }

    fn scene(gaussians: Vec<Gaussian>) -> GaussianScene {
        let harmonics = Harmonics { coefficients: 1, values: vec![0.5; gaussians.len() * 3], ..Harmonics::default() };
        RuntimeScene::sliced(gaussians, harmonics).into()
    }

    /// Returns the indices that one edit keeps.
    fn kept_by(scene: &GaussianScene, edit: Edit) -> Vec<u32> {
        kept(scene, &EditList { edits: vec![edit] }, None).expect("some Gaussians are kept").0
    }

    fn box_around(x: f32, y: f32, times: Option<[f32; 2]>) -> Edit {
        Edit::RemoveBox { min: [x - 0.1, y - 0.1, -1.0], max: [x + 0.1, y + 0.1, 1.0], times }
    }

    #[test]
    fn a_region_removes_what_is_in_it_or_outside_of_it() {
        let all = scene((0..5).map(|x| gaussian(x as f32, 0.5, f32::INFINITY)).collect());
        let (min, max) = ([1.0, -1.0, -1.0], [3.0, 1.0, 1.0]);
        assert_eq!(kept_by(&all, Edit::KeepBox { min, max, times: None }), [1, 2, 3], "borders are inside");
        assert_eq!(kept_by(&all, Edit::RemoveBox { min, max, times: None }), [0, 4], "the others");
        let (center, radius) = ([2.0, 0.0, 0.0], 1.0);
        assert_eq!(kept_by(&all, Edit::KeepSphere { center, radius, times: None }), [1, 2, 3], "a sphere");
        assert_eq!(kept_by(&all, Edit::RemoveSphere { center, radius, times: None }), [0, 4], "the others");
    }

    #[test]
    fn edits_that_leave_invisible_gaussians_alone_are_refused() {
        let filler = Gaussian { opacity: 0.0, ..gaussian(3.0, 0.5, 1.0) };
        let all = scene(vec![gaussian(0.0, 0.5, 1.0), filler]);
        let edit = Edit::RemoveFaintLarge { opacity_below: 2.0, scale_above: 0.0 };
        let refused = kept(&all, &EditList { edits: vec![edit] }, None).expect_err("only the filler is left");
        assert!(matches!(refused, EditError::Everything { number: 1, .. }), "{refused}");
    }

    #[test]
    fn numbers_of_edits_in_code_are_checked() {
        let all = scene(vec![gaussian(0.0, 0.5, 1.0)]);
        let edit = Edit::RemoveBox { min: [1.0; 3], max: [f32::NAN; 3], times: None };
        let refused = kept(&all, &EditList { edits: vec![edit] }, None).expect_err("no box");
        assert!(matches!(refused, EditError::Wrong { number: 1, .. }), "{refused}");
    }

    #[test]
    fn a_gaussian_is_where_it_is_most_opaque_within_the_stretch() {
        // A short life, one as long as the interval, one whose mean is after the interval, one that is never drawn.
        let lives = [(0.5, 0.05), (0.5, 10.0), (1.5, 10.0), (1.5, 0.01)];
        let at = |(x, (mean_t, sigma_t)): (usize, (f32, f32))| gaussian(x as f32, mean_t, sigma_t);
        let all = scene(lives.into_iter().enumerate().map(at).collect());
        assert_eq!(kept_by(&all, box_around(0.0, 0.0, None)), [1, 2, 3], "at its own time");
        assert_eq!(kept_by(&all, box_around(0.0, 0.0, Some([0.7, 0.9]))), [0, 1, 2, 3], "it does not live then");
        let late = box_around(0.0, 0.12, Some([0.62, 0.9]));
        assert_eq!(kept_by(&all, late), [1, 2, 3], "shortly before its end at 0.622");
        assert_eq!(kept_by(&all, box_around(1.0, 0.4, Some([0.9, 2.0]))), [0, 2, 3], "at the begin of the stretch");
        assert_eq!(kept_by(&all, box_around(1.0, 0.0, Some([0.9, 2.0]))), [0, 1, 2, 3], "and at no other time");
        assert_eq!(kept_by(&all, box_around(2.0, -0.5, None)), [0, 1, 3], "the last time of the interval");
        assert_eq!(kept_by(&all, box_around(3.0, -0.5, None)), [0, 1, 2], "also if it is never drawn");
        let keep = Edit::KeepBox { min: [5.0; 3], max: [6.0; 3], times: Some([0.7, 0.9]) };
        assert_eq!(kept_by(&all, keep), [0, 3], "what does not live in the stretch is not touched");
    }

    #[test]
    fn windows_of_time_are_part_of_a_life() {
        let mut all = scene(vec![gaussian(0.0, 0.5, f32::INFINITY), gaussian(0.0, 0.5, f32::INFINITY)]);
        let filter = |kind| {
            let sets = ActiveSets::Intervals(vec![1 << 16, 2 | 3 << 16]);
            Some(TemporalFilter { kind, segments: 4, count: 2, sets })
        };
        all.filter = filter(FilterKind::Window);
        assert_eq!(kept_by(&all, box_around(0.0, 0.2, Some([0.7, 0.9]))), [0], "the first is gone by then");
        all.filter = filter(FilterKind::Support);
        let all_removed = kept(&all, &EditList { edits: vec![box_around(0.0, 0.2, Some([0.7, 0.9]))] }, None);
        let everything = EditError::Everything { number: 1, name: "remove_box" };
        assert_eq!(all_removed, Err(everything), "other filters are no part of a capture; an empty one is refused");
    }

    #[test]
    fn faint_and_large_is_both() {
        let with = |opacity, variance: f32| Gaussian {
            opacity,
            // The longest axis is along the diagonal of x and y.
            covariance: [variance, variance * 0.5, 0.0, variance, 0.0, 1e-6],
            ..gaussian(0.0, 0.5, 1.0)
        };
        assert!((largest_deviation(&with(0.1, 4.0)) - 6.0f32.sqrt()).abs() < 1e-5, "the eigenvalue is 1.5 times 4");
        let all = scene(vec![with(0.05, 4.0), with(0.5, 4.0), with(0.05, 0.01), with(0.1, 4.0)]);
        let fog = Edit::RemoveFaintLarge { opacity_below: 0.1, scale_above: 1.0 };
        assert_eq!(kept_by(&all, fog), [1, 2, 3], "opaque ones and small ones stay");
    }

    #[test]
    fn floaters_are_those_of_few_and_near_cameras() {
        let all = scene((0..4).map(|x| gaussian(x as f32, 0.5, 1.0)).collect());
        let list = EditList { edits: vec![Edit::RemoveFloaters { cameras_below: 3, distance_below: 0.5 }] };
        let missing = EditError::NotSeen { number: 1, name: "remove_floaters" };
        assert_eq!(apply(all.clone(), &list, None), Err(missing), "without cameras");
        let seen = Seen { cameras: vec![2, 2, 3, 0], nearest: vec![0.4, 0.5, 0.1, f32::INFINITY] };
        let found = kept(&all, &list, Some(&seen)).expect("three are kept");
        assert_eq!(found, (vec![1, 2, 3], vec![1]), "far ones and those of many cameras stay");
    }

    #[test]
    fn each_form_keeps_the_bits_of_what_remains() {
        let trained = synthesize(&SynthSettings { count: 900, degree: 1, ..SynthSettings::default() });
        let runtime = trained.clone().into_runtime().expect("a synthetic scene can be drawn");
        let packed = runtime.clone().pack(&Packing::default()).expect("the scene fits");
        let list = EditList {
            edits: vec![
                Edit::KeepBox { min: [-0.5, -2.0, -2.0], max: [2.0; 3], times: None },
                Edit::RemoveSphere { center: [0.0; 3], radius: 0.3, times: Some([0.2, 0.6]) },
            ],
        };
        for scene in [trained, runtime.into(), packed.into()] {
            let (keep, removed) = kept(&scene, &list, None).expect("some are kept");
            let edited = apply(scene.clone(), &list, None).expect("some are kept");
            assert!(removed.iter().all(|&count| count > 0), "both edits remove some: {removed:?}");
            assert_eq!(edited.removed.iter().sum::<usize>() + edited.kept, scene.len(), "all are counted");
            assert_eq!(edited.scene.check(), Ok(()), "the parts fit together");
            let is_packed = matches!(scene.form, SceneForm::Ready(Form::Packed(_)));
            assert_eq!(edited.fillers() > 0, is_packed, "only blocks are filled");
            let before = scene.gaussians().expect("they can be drawn");
            let after = edited.scene.gaussians().expect("they can be drawn");
            let visible: Vec<&Gaussian> = after.iter().filter(|gaussian| gaussian.opacity > 0.0).collect();
            let expected: Vec<&Gaussian> = keep.iter().map(|&index| &before[index as usize]).collect();
            assert_eq!(visible, expected, "the same Gaussians");
            let none = apply(scene.clone(), &EditList::default(), None).expect("nothing is removed");
            assert_eq!((none.scene, none.removed), (scene.clone(), Vec::new()), "without edits it is the original");
        }
    }
}
