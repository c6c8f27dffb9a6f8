//! The warnings that code logs.
//!
//! In: code to run on this thread. Out: the texts of its warnings and errors, in order.

use crate::support::warning_layer::Warnings;
use bevy::log::tracing::subscriber::with_default;
use bevy::log::tracing_subscriber::layer::SubscriberExt;
use bevy::log::tracing_subscriber::registry::Registry;
use std::sync::{Arc, Mutex, PoisonError};

/// Runs code and returns the warnings and errors that it has logged on this thread.
pub fn warnings_of(run: impl FnOnce()) -> Vec<String> {
    let logged = Arc::new(Mutex::new(Vec::new()));
    let sink = logged.clone();
    let record = move |text: String| sink.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    with_default(Registry::default().with(Warnings(record)), run);
    let logged = logged.lock().unwrap_or_else(PoisonError::into_inner);
    logged.clone()
}
