//! Holding out validation views, on which score, count, loss, rounds and step are chosen.
//!
//! In: the training views of a dataset. Out: the views to train on and the views to validate on ([`HeldOut`]). A
//! validation view shares neither its camera nor its interval of time with the training views, as far as the dataset
//! allows: single views between training views would only measure how well neighboring views are reproduced.

use super::TrainingView;
use super::Validation;
use super::selection::{distinct_cameras, distinct_times, identity};
use std::collections::HashSet;

/// Fraction of the cameras, or of the times, that is held out.
const FRACTION: f64 = 0.1;
/// Fewest cameras of which some are held out.
const FEWEST_CAMERAS: usize = 4;
/// Fewest distinct times of which blocks are held out.
const FEWEST_TIMES: usize = 8;
/// Number of blocks of time.
const BLOCKS: usize = 3;

/// The views of a training split, divided.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    /// The views to train on.
    pub train: Vec<TrainingView>,
    /// The views to validate on.
    pub validation: Vec<TrainingView>,
    /// The way in which the validation views were found: never [`Validation::Auto`].
    pub by: Validation,
}

/// Divides training views by whole cameras or by blocks of time. `wanted` selects the way; with [`Validation::Auto`],
/// whole cameras if there are at least four cameras of several views each (or if all views have the same time), else
/// blocks of time if there are at least eight distinct times, else nothing is held out. Returns `None` if the views do
/// not allow the wanted way.
pub fn hold_out(views: &[TrainingView], wanted: Validation) -> Option<HeldOut> {
    let cameras = distinct_cameras(views).len();
    let times = distinct_times(views);
    let by_cameras = cameras >= FEWEST_CAMERAS && (views.len() >= 2 * cameras || times == 1);
    let by_times = times >= FEWEST_TIMES;
    let by = match wanted {
        Validation::Auto if by_cameras => Validation::Cameras,
        Validation::Auto if by_times => Validation::Times,
        Validation::Auto | Validation::None => Validation::None,
        Validation::Cameras if cameras >= 2 => Validation::Cameras,
        Validation::Times if times >= 2 => Validation::Times,
        Validation::Cameras | Validation::Times | Validation::File => return None,
    };
    let is_held: Box<dyn Fn(&TrainingView) -> bool> = match by {
        Validation::Cameras => {
            let all = distinct_cameras(views);
            let held: HashSet<_> = held_places(all.len(), 1).into_iter().map(|place| identity(&all[place])).collect();
            Box::new(move |view| held.contains(&identity(&view.camera)))
        }
        Validation::Times => {
            let mut all: Vec<f32> = views.iter().map(|view| view.time).collect();
            all.sort_by(f32::total_cmp);
            all.dedup();
            let held: HashSet<u32> =
                held_places(all.len(), BLOCKS).into_iter().map(|place| all[place].to_bits()).collect();
            Box::new(move |view| held.contains(&view.time.to_bits()))
        }
        Validation::Auto | Validation::File | Validation::None => Box::new(|_| false),
    };
    let (validation, train) = views.iter().cloned().partition(|view| is_held(view));
    Some(HeldOut { train, validation, by })
}

/// Returns which of `count` places are held out: a tenth of them, at least one and never all. With one block, places
/// are evenly spaced; with several blocks, the places of a block are consecutive, and blocks are evenly spaced.
fn held_places(count: usize, blocks: usize) -> Vec<usize> {
    let wanted = ((count as f64 * FRACTION).round() as usize).clamp(1, count.saturating_sub(1).max(1));
    let (blocks, length) = match blocks {
        1 => (wanted, 1),
        blocks => {
            let blocks = blocks.min(wanted);
            (blocks, wanted / blocks)
        }
    };
    let place = |block: usize, offset: usize| (2 * block + 1) * count / (2 * blocks) - length / 2 + offset;
    (0..blocks).flat_map(|block| (0..length).map(move |offset| place(block, offset))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Camera;
    use glam::{Mat4, UVec2, Vec3};

    /// Returns the view of camera `camera` at time `time`.
    fn view(camera: usize, time: f32) -> TrainingView {
        let size = UVec2::splat(8);
        let world_to_camera = Mat4::from_translation(Vec3::X * camera as f32);
        TrainingView {
            name: format!("{camera}-{time}"),
            camera: Camera { world_to_camera, size, lens: Camera::fov_lens(0.7, size) },
            time,
            original: size,
            image: "none.png".into(),
            mask: None,
            correction: Default::default(),
        }
    }

    fn divided(views: &[TrainingView], wanted: Validation) -> HeldOut {
        hold_out(views, wanted).expect("the views allow it")
    }

    #[test]
    fn a_rig_of_cameras_holds_out_whole_cameras() {
        let views: Vec<_> = (0..600).map(|index| view(index / 30, (index % 30) as f32)).collect();
        let HeldOut { train, validation, by } = divided(&views, Validation::Auto);
        assert_eq!((by, train.len(), validation.len()), (Validation::Cameras, 540, 60), "two of twenty cameras");
        let cameras =
            |views: &[TrainingView]| -> HashSet<_> { views.iter().map(|view| identity(&view.camera)).collect() };
        assert!(cameras(&train).is_disjoint(&cameras(&validation)), "no camera is in both parts");
    }

    #[test]
    fn a_moving_camera_holds_out_contiguous_blocks_of_time() {
        let views: Vec<_> = (0..150).map(|index| view(index, index as f32)).collect();
        let HeldOut { train, validation, by } = divided(&views, Validation::Auto);
        assert_eq!((by, train.len(), validation.len()), (Validation::Times, 135, 15), "a tenth of the views");
        let times: Vec<usize> = validation.iter().map(|view| view.time as usize).collect();
        let gaps = times.windows(2).filter(|pair| pair[1] != pair[0] + 1).count();
        assert_eq!(gaps, 2, "three blocks without gaps: {times:?}");
        assert!(times[0] > 0 && times[14] < 149, "both ends of the time interval are trained on: {times:?}");
    }

    #[test]
    fn a_static_scene_holds_out_cameras() {
        let views: Vec<_> = (0..20).map(|index| view(index, 0.5)).collect();
        let HeldOut { validation, by, .. } = divided(&views, Validation::Auto);
        assert_eq!((by, validation.len()), (Validation::Cameras, 2), "two of twenty views");
    }

    #[test]
    fn few_views_are_held_out_only_on_request() {
        let views: Vec<_> = (0..3).map(|index| view(index, index as f32)).collect();
        let HeldOut { train, validation, by } = divided(&views, Validation::Auto);
        assert_eq!((by, train.len(), validation.len()), (Validation::None, 3, 0), "all three views are trained on");
        let asked = divided(&views, Validation::Times);
        assert_eq!((asked.train.len(), asked.validation.len()), (2, 1), "one time of three");
        assert_eq!(hold_out(&views[..1], Validation::Cameras), None, "a single camera cannot be held out");
    }

    #[test]
    fn held_out_places_are_in_range_and_distinct() {
        for count in 2..400 {
            for blocks in [1, 3] {
                let places = held_places(count, blocks);
                let distinct: HashSet<_> = places.iter().collect();
                assert_eq!(distinct.len(), places.len(), "places of {count} are distinct: {places:?}");
                assert!(places.iter().all(|&place| place < count), "places of {count} are below {count}: {places:?}");
                assert!(!places.is_empty() && places.len() < count, "some of {count}, not all: {places:?}");
            }
        }
    }
}
