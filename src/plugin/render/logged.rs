//! Failures in the log: each different message once.
//!
//! In: the message of a failure, in every frame in which it occurs. Out: one line in the log.

use bevy::log::{error, warn};
use std::collections::{BTreeMap, HashSet};
use std::panic::Location;
use std::sync::{Mutex, PoisonError};

/// The messages logged so far, by all apps of the process.
static LOGGED: Mutex<Logged> = Mutex::new(Logged(BTreeMap::new()));

/// Messages that have been logged, by the place in the source that logs them.
struct Logged(BTreeMap<&'static Location<'static>, HashSet<String>>);

impl Logged {
    /// Most messages of one place that are logged: messages may contain a size that changes in every frame.
    const MOST: usize = 64;

    /// Records a message. Returns whether it must be logged.
    fn is_new(&mut self, place: &'static Location<'static>, message: &str) -> bool {
        let known = self.0.entry(place).or_default();
        known.len() < Self::MOST && known.insert(message.to_owned())
    }
}

/// Logs an error, unless the caller has logged the same message before.
#[track_caller]
pub(crate) fn error_once_each(message: &str) {
    if LOGGED.lock().unwrap_or_else(PoisonError::into_inner).is_new(Location::caller(), message) {
        error!("{message}");
    }
}

/// Logs a warning, unless the caller has logged the same message before.
#[track_caller]
pub(crate) fn warn_once_each(message: &str) {
    if LOGGED.lock().unwrap_or_else(PoisonError::into_inner).is_new(Location::caller(), message) {
        warn!("{message}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_different_message_of_a_place_is_logged_once_up_to_the_maximum() {
        let mut logged = Logged(BTreeMap::new());
        let memory = Location::caller();
        let news = ["no memory", "no memory", "too large", "no memory"].map(|message| logged.is_new(memory, message));
        assert_eq!(news, [true, false, true, false], "a second, different message is logged");
        let more = (0..1000).filter(|number| logged.is_new(memory, &format!("{number} bytes"))).count();
        assert_eq!(more, Logged::MOST - 2, "messages with a changing number are logged up to the maximum");
        let picks = Location::caller();
        assert!(logged.is_new(picks, "not picked"), "another place has its own messages");
    }
}
