//! Lists of edits.
//!
//! In: lists with every kind of edit. Out: lists with wrong numbers, names and structures; errors have their place in
//! the text, accepted lists are written and read again, and edit a scene in each form.

use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::text;
use crate::support::packed_scene;
use crate::support::random::Random;
use bevy_gs4d::scene::edit::{EditList, EditListError, Edited, Seen, apply};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, Packing};

/// Gaussians of the scenes.
const COUNT: usize = 60;
/// Most edits of a list that is applied to every form; a longer one is applied to the first.
const EDITS: usize = 200;
/// Most bytes of a list.
const MOST: usize = 1 << 20;
/// Lists that leave some Gaussians.
const SEEDS: [&str; 4] = [
    "[\n    keep_box(min: (-2, -2, -1), max: (0.5, 2, 2.5)), // the stage\n    \
     remove_sphere(center: (-0.5, -0.5, 0), radius: 0.4, times: (0.2, 0.6)),\n]\n",
    "[\n    remove_box(min: (0, 0, -1), max: (2, 2, 2), times: (0.5, 0.75)),\n    \
     keep_sphere(center: (0, 0, 0), radius: 1.2),\n]\n",
    "[\n    remove_faint_large(opacity_below: 0.5, scale_above: 0.1),\n    \
     remove_floaters(cameras_below: 3, distance_below: 0.4),\n]\n",
    "[keep_box(min: (-1, -1, -1), max: (1, 1, 1), times: Some((0.0, 0.4))), \
     remove_box(min: (-0.2, -0.2, -1), max: (0.2, 0.2, 1)), remove_sphere(center: (0.5, 0, 0.3), radius: 0.25), \
     keep_sphere(center: (0, 0, 0.2), radius: 0.9, times: (0.5, 0.5))]",
];

/// The reader of lists of edits.
pub struct Edits {
    /// The trained, the sliced and the packed form, the last two with a filter.
    forms: [GaussianScene; 3],
    seen: Seen,
}

impl Edits {
    /// Makes the scenes.
    pub fn new() -> Self {
        let trained = synthesize(&SynthSettings { count: COUNT, degree: 1, ..SynthSettings::default() });
        let sliced = packed_scene::scene(COUNT, 1, 0);
        let packed = sliced.clone().pack(&Packing::default()).expect("the scene fits");
        let seen = Seen {
            cameras: (0..COUNT).map(|index| index as u32 % 6).collect(),
            nearest: (0..COUNT).map(|index| (index % 5) as f32 * 0.2).collect(),
        };
        for seed in SEEDS {
            let list = EditList::parse(seed.as_bytes()).expect("the seed is a list");
            apply(trained.clone(), &list, Some(&seen)).expect("the seed leaves some Gaussians");
        }
        Self { forms: [trained, sliced.into(), packed.into()], seen }
    }
}

impl Reader for Edits {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        text::file(&SEEDS, random)
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let list = match EditList::parse(bytes) {
            Ok(list) => list,
            Err(error) => return refused(bytes, &error),
        };
        write_and_read(&list)?;
        if list.needs_cameras() && apply(self.forms[0].clone(), &list, None).is_ok() {
            return Err("asks what cameras see, and is applied without cameras".to_owned());
        }
        let forms = if list.edits.len() > EDITS { &self.forms[..1] } else { &self.forms[..] };
        let mut outcome = Outcome::Drawn;
        for scene in forms {
            match apply(scene.clone(), &list, Some(&self.seen)) {
                Ok(edited) => check(edited, &list, scene.len())?,
                Err(error) => outcome = Outcome::Refused(error.to_string()),
            }
        }
        Ok(outcome)
    }
}

/// Checks that the error of a text has its place in it, or that the text is too long.
fn refused(text: &[u8], error: &EditListError) -> Result<Outcome, String> {
    let is_placed = match *error {
        EditListError::Text { line, column, .. } => {
            // What is no UTF-8 is not in front of the place.
            let text = String::from_utf8_lossy(text);
            let found = line.checked_sub(1).and_then(|before| text.split('\n').nth(before));
            found.is_some_and(|line| (1..=line.chars().count() + 1).contains(&column))
        }
        _ => text.len() > MOST,
    };
    if is_placed {
        Ok(Outcome::Refused(error.to_string()))
    } else {
        Err(format!("is refused at a place that it does not have: {error}"))
    }
}

/// Checks that a list can be written, and that the text is the same list.
fn write_and_read(list: &EditList) -> Result<(), String> {
    let text = ron::to_string(list).map_err(|error| format!("is accepted and cannot be written: {error}"))?;
    match EditList::parse(text.as_bytes()) {
        Ok(again) if again == *list => Ok(()),
        Ok(_) => Err("is written and read as another list".to_owned()),
        // Numbers may be longer than they were.
        Err(EditListError::TooLong { .. }) => Ok(()),
        Err(error) => Err(format!("is written and cannot be read: {error}")),
    }
}

/// Checks the counts of an edited scene that had `count` Gaussians, and the scene itself, which must be drawable.
fn check(edited: Edited, list: &EditList, count: usize) -> Result<(), String> {
    let Edited { scene, removed, kept } = edited;
    if removed.len() != list.edits.len() || kept + removed.iter().sum::<usize>() != count || scene.len() < kept {
        return Err(format!("leaves {kept} of {count} Gaussians, {} in the scene, by {removed:?}", scene.len()));
    }
    scene.check().map_err(|reason| format!("edits a scene, but {reason}"))?;
    match accepted::check(scene, DrawnBy::Cpu)? {
        Outcome::Refused(reason) => Err(format!("edits a scene that cannot be drawn then: {reason}")),
        Outcome::Accepted | Outcome::Drawn => Ok(()),
    }
}
