//! The warnings that code logs.
//!
//! In: code to run on this thread. Out: the texts of its warnings and errors, in order.

use bevy::log::tracing::field::{Field, Visit};
use bevy::log::tracing::subscriber::with_default;
use bevy::log::tracing::{Event, Level, Subscriber};
use bevy::log::tracing_subscriber::Layer;
use bevy::log::tracing_subscriber::layer::{Context, SubscriberExt};
use bevy::log::tracing_subscriber::registry::Registry;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

/// A layer that records warnings and errors.
struct Warnings(Arc<Mutex<Vec<String>>>);

impl<S: Subscriber> Layer<S> for Warnings {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        // More severe levels are less in the order of levels.
        if *event.metadata().level() <= Level::WARN {
            let mut text = Text(String::new());
            event.record(&mut text);
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(text.0);
        }
    }
}

struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// Runs code and returns the warnings and errors that it has logged on this thread.
pub fn warnings_of(run: impl FnOnce()) -> Vec<String> {
    let logged = Arc::new(Mutex::new(Vec::new()));
    with_default(Registry::default().with(Warnings(logged.clone())), run);
    let logged = logged.lock().unwrap_or_else(PoisonError::into_inner);
    logged.clone()
}
