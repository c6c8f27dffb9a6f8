//! A renderer that tests of one process use in turn.
//!
//! In: the renderer of [`gpu`](super::gpu). Out: [`Lent`]. A test that has passed returns it, with the settings of a new
//! one, to those that follow: a software driver compiles the passes much longer than it draws most pictures.

use crate::support::gpu;
use bevy_gs4d::renderer::{ColorPrecision, Design, Headless};
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// The renderers that no test uses.
static FREE: Mutex<Vec<Headless>> = Mutex::new(Vec::new());

/// A renderer for one test; it is there until it is dropped.
pub struct Lent(Option<Headless>);

impl Deref for Lent {
    type Target = Headless;

    fn deref(&self) -> &Headless {
        self.0.as_ref().expect("it is not dropped")
    }
}

impl DerefMut for Lent {
    fn deref_mut(&mut self) -> &mut Headless {
        self.0.as_mut().expect("it is not dropped")
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        // What a test that has failed leaves behind is not known.
        let Some(mut headless) = self.0.take().filter(|_| !thread::panicking()) else { return };
        // A change of design releases all buffers.
        for design in Design::NAMES.map(|(_, design)| design).into_iter().chain([Design::Auto]) {
            headless.set_design(design);
        }
        headless.use_filters(true);
        headless.measure_depths(false);
        headless.measure_precision(ColorPrecision::Single);
        FREE.lock().unwrap_or_else(PoisonError::into_inner).push(headless);
    }
}

/// Returns a renderer; without an adapter, as [`gpu::headless`].
pub fn headless() -> Option<Lent> {
    let free = FREE.lock().unwrap_or_else(PoisonError::into_inner).pop();
    free.or_else(gpu::headless).map(|headless| Lent(Some(headless)))
}
