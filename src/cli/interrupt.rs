//! Ctrl-C: leave at once with exit code 130, but never in the middle of a file.
//!
//! In: the closures that write files. Out: files that are whole or absent. They are written beside their place and renamed;
//! the handler waits until the ones under way are in place, so that not even a temporary file stays behind.

use std::sync::RwLock;

/// Held for reading while a file is written, for writing by the handler.
static WRITING: RwLock<()> = RwLock::new(());

/// Sets the handler of SIGINT, SIGTERM and SIGHUP.
///
/// # Errors
/// The system refuses it.
pub fn install() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        let _all_files_whole = WRITING.write();
        std::process::exit(130);
    })
}

/// Runs a closure that writes a file, undisturbed.
pub fn whole<T>(write: impl FnOnce() -> T) -> T {
    let _writing = WRITING.read();
    write()
}
