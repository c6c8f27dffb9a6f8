//! Compilation of variants of passes on another thread, so that no frame waits for the driver.
//!
//! In: the passes of a device, a variant that a view wants. Out: the same passes, compiled after some frames. A variant that the device refuses
//! is tried once: views go on with the variants they have.

use super::passes::Passes;
use super::shaders::Storage;
use super::tile_bins::BinVariant;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

/// Passes of tile bins: the captures that are drawn, and the variant.
type Wanted = (Vec<(Storage, bool)>, BinVariant);

/// The variants whose compilation has begun.
#[derive(Debug, Default)]
pub(super) struct Compiling(Mutex<Vec<Wanted>>);

impl Compiling {
    /// Begins to compile the passes of tile bins for these storages, unless this has begun before.
    pub(super) fn begin(
        &self,
        passes: &Arc<Passes>,
        device: &wgpu::Device,
        drawn: Vec<(Storage, bool)>,
        variant: BinVariant,
    ) {
        let mut begun = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = (drawn, variant);
        if begun.contains(&wanted) {
            return;
        }
        let (passes, device, drawn) = (Arc::clone(passes), device.clone(), wanted.0.clone());
        let compile = move || passes.tile_bins.compile(&device, drawn.into_iter(), variant);
        let _ = self.thread(move || drop(compile()));
        begun.push(wanted);
    }

    /// Runs `compile` on another thread; `None` if the system has no room for one: views go on with the variants they have.
    pub(super) fn thread(&self, compile: impl FnOnce() + Send + 'static) -> Option<JoinHandle<()>> {
        thread::Builder::new().name("gs4d pipelines".to_owned()).spawn(compile).ok()
    }
}
