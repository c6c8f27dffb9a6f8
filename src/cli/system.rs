//! Errors of the operating system, in words.
//!
//! In: a message with a text of the system in it, which ends in `(os error N)`. Out: the message with a sentence that says what helps in
//! place of that text.

use std::io::{self, ErrorKind};

/// What comes before the number in a text of the system.
const MARK: &str = " (os error ";

/// Returns a message with common errors of the system in words; others stay as they are.
pub fn in_words(message: &str) -> String {
    let Some(error) = first(message) else { return message.to_owned() };
    match (error.to_string(), words(&error)) {
        (text, Some(words)) if message.contains(&text) => in_words(&message.replace(&text, words)),
        _ => message.to_owned(),
    }
}

/// Returns whether a message is about a pipe whose reader has ended.
pub fn is_closed_pipe(message: &str) -> bool {
    first(message).is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
}

/// Returns the first error of the system in a message.
fn first(message: &str) -> Option<io::Error> {
    let (_, rest) = message.split_once(MARK)?;
    let (number, _) = rest.split_once(')')?;
    Some(io::Error::from_raw_os_error(number.parse().ok()?))
}

/// The numbers of errors that have no stable kind: a fault of the device, and too many symbolic links.
const DEVICE_FAULT: i32 = 5;
const TOO_MANY_LINKS: i32 = if cfg!(any(target_os = "linux", target_os = "android")) { 40 } else { 62 };

fn words(error: &io::Error) -> Option<&'static str> {
    if cfg!(unix) {
        match error.raw_os_error() {
            Some(DEVICE_FAULT) => {
                return Some("the disk or device reports a fault: check it, or choose a path on another one");
            }
            Some(TOO_MANY_LINKS) => {
                return Some("symbolic links lead in a circle here: remove the link, or choose another path");
            }
            _ => {}
        }
    }
    Some(match error.kind() {
        ErrorKind::NotFound => "there is no such file or folder: check the path",
        ErrorKind::PermissionDenied => "permission is denied: change the permissions, or choose another path",
        ErrorKind::AlreadyExists => "a file of this name is in the way: remove it, or choose another path",
        ErrorKind::IsADirectory => "this is a folder: name a file",
        ErrorKind::NotADirectory => "a part of this path is a file, not a folder: check the path",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "no space is left on the disk: free some, or write to another one"
        }
        ErrorKind::ReadOnlyFilesystem => "the disk can only be read: write to another one",
        ErrorKind::FileTooLarge => "files of this size do not fit the disk: write to another one",
        ErrorKind::InvalidFilename => "the disk takes no file of this name: choose a shorter or plainer one",
        ErrorKind::BrokenPipe => "the program that reads this has ended",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_says_is_put_in_words() {
        // On every system the number of a missing file.
        let missing = io::Error::from_raw_os_error(2);
        let message = in_words(&format!("a.gs4d: {missing}; b.gs4d: {missing}"));
        let words = "there is no such file or folder: check the path";
        assert_eq!(message, format!("a.gs4d: {words}; b.gs4d: {words}"), "every one");
        for message in ["", "a.gs4d: damaged", "said (os error 2)", "cut off (os error ", "unseen (os error 98765)"] {
            assert_eq!(in_words(message), message, "as it is");
        }
        assert!(!is_closed_pipe(&missing.to_string()), "another error");
    }

    #[cfg(unix)]
    #[test]
    fn faults_of_devices_and_circles_of_links_are_put_in_words() {
        for (number, words) in [(DEVICE_FAULT, "reports a fault"), (TOO_MANY_LINKS, "lead in a circle")] {
            let message = in_words(&format!("a.gs4d: {}", io::Error::from_raw_os_error(number)));
            assert!(message.starts_with("a.gs4d: ") && message.contains(words), "{number}: {words}: {message}");
            assert!(!message.contains("os error"), "no number of the system: {message}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn closed_pipes_are_known() {
        // EPIPE.
        assert!(is_closed_pipe(&format!("out.gs4d: {}", io::Error::from_raw_os_error(32))), "the reader has ended");
    }
}
