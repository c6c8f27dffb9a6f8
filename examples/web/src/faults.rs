//! Faults of the graphics device, which it reports some time after they happened.
//!
//! In: a device. Out: [`Faults`], whose first message the page shows; and panics of the program on the console of the
//! browser, and as a message for the page.

use std::sync::{Arc, Mutex, PoisonError};
use wasm_bindgen::prelude::wasm_bindgen;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console)]
    fn error(message: &str);
}

/// The first fault of a device.
#[derive(Debug, Clone, Default)]
pub struct Faults(Arc<Mutex<Option<String>>>);

impl Faults {
    /// Collects the faults of a device.
    pub fn of(device: &wgpu::Device) -> Self {
        let faults = Self::default();
        let (uncaptured, lost) = (faults.clone(), faults.clone());
        device.on_uncaptured_error(Arc::new(move |fault: wgpu::Error| uncaptured.note(fault.to_string())));
        device.set_device_lost_callback(move |_, reason| lost.note(format!("the graphics device was lost: {reason}")));
        faults
    }

    fn note(&self, message: String) {
        error(&message);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
    }

    /// Returns the first fault, once.
    pub fn take(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// The message of the first panic.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Writes the message of a panic to the console, and keeps the first one for [`panic_message`].
pub fn report_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let message = panic.to_string();
        error(&message);
        PANIC.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
    }));
}

/// Returns the message of the panic that has ended the program, if it was one: without memory it ends without a
/// message.
#[wasm_bindgen]
pub fn panic_message() -> Option<String> {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone()
}
