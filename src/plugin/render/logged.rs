//! Failures in the log: each different message once.
//!
//! In: the message of a failure, in every frame in which it occurs. Out: one line in the log.

use bevy::log::{error, warn};
use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};

/// The messages logged so far, by all apps of the process.
static LOGGED: Mutex<Logged> = Mutex::new(Logged(None));

/// Messages that have been logged.
struct Logged(Option<HashSet<String>>);

impl Logged {
    /// Most messages that are logged: messages may contain a size that changes in every frame.
    const MOST: usize = 64;

    /// Records a message. Returns whether it must be logged.
    fn is_new(&mut self, message: &str) -> bool {
        let known = self.0.get_or_insert_default();
        known.len() < Self::MOST && known.insert(message.to_owned())
    }
}

/// Logs an error, unless the same message has been logged before.
pub(crate) fn error_once_each(message: &str) {
    if LOGGED.lock().unwrap_or_else(PoisonError::into_inner).is_new(message) {
        error!("{message}");
    }
}

/// Logs a warning, unless the same message has been logged before.
pub(crate) fn warn_once_each(message: &str) {
    if LOGGED.lock().unwrap_or_else(PoisonError::into_inner).is_new(message) {
        warn!("{message}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_different_message_is_logged_once_up_to_the_maximum() {
        let mut logged = Logged(None);
        let news = ["no memory", "no memory", "too large", "no memory"].map(|message| logged.is_new(message));
        assert_eq!(news, [true, false, true, false], "a second, different message is logged");
        let more = (0..1000).filter(|number| logged.is_new(&format!("{number} bytes"))).count();
        assert_eq!(more, Logged::MOST - 2, "messages with a changing number are logged up to the maximum");
    }
}
