//! Errors of the operating system as sentences.
//!
//! In: a message that contains a text of the operating system, which ends in `(os error N)`. Out: the message with a
//! sentence in place of that text: the error and its remedy.

use std::io::{self, ErrorKind};

/// The part of a text of the operating system before the error number.
const MARK: &str = " (os error ";

/// Returns a message in which texts of common errors are replaced by sentences. Other texts are unchanged.
pub(crate) fn in_words(message: &str) -> String {
    let Some(error) = first(message) else { return message.to_owned() };
    match (error.to_string(), words(&error)) {
        (text, Some(words)) if message.contains(&text) => in_words(&message.replace(&text, words)),
        _ => message.to_owned(),
    }
}

/// Returns whether the first error in a message is a closed pipe: the program that reads the output has ended.
pub(crate) fn is_closed_pipe(message: &str) -> bool {
    first(message).is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
}

/// Returns the first error of the operating system in a message.
fn first(message: &str) -> Option<io::Error> {
    let (_, rest) = message.split_once(MARK)?;
    let (number, _) = rest.split_once(')')?;
    Some(io::Error::from_raw_os_error(number.parse().ok()?))
}

/// The numbers of errors that have no stable kind: a fault of the device, and too many symbolic links.
const DEVICE_FAULT: i32 = 5;
const TOO_MANY_LINKS: i32 = if cfg!(any(target_os = "linux", target_os = "android")) { 40 } else { 62 };

/// Returns the sentence for an error; `None` if it has none.
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
    fn texts_of_common_system_errors_are_replaced_by_sentences() {
        // The number of a missing file on every system.
        let missing = io::Error::from_raw_os_error(2);
        let message = in_words(&format!("a.gs4d: {missing}; b.gs4d: {missing}"));
        let words = "there is no such file or folder: check the path";
        assert_eq!(message, format!("a.gs4d: {words}; b.gs4d: {words}"), "every text is replaced");
        for message in ["", "a.gs4d: damaged", "said (os error 2)", "cut off (os error ", "unknown (os error 98765)"] {
            assert_eq!(in_words(message), message, "a message without a known error is unchanged");
        }
        assert!(!is_closed_pipe(&missing.to_string()), "a missing file is no closed pipe");
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
    fn closed_pipes_are_recognized() {
        // The number of EPIPE.
        assert!(is_closed_pipe(&format!("out.gs4d: {}", io::Error::from_raw_os_error(32))), "EPIPE is a closed pipe");
    }
}
