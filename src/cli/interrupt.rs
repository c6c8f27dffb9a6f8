//! Ctrl-C: exits at once with code 130, but never in the middle of a file.
//!
//! In: the closures that write files. Out: files that are whole or absent. Files are written under a temporary name and
//! renamed; the handler waits until those being written are complete, so that no temporary file is left behind.

use std::sync::RwLock;

/// Locked for reading while a file is written, and for writing by the handler.
static WRITING: RwLock<()> = RwLock::new(());

/// Sets the handler of SIGINT, SIGTERM and SIGHUP.
///
/// # Errors
/// The operating system refuses it.
pub fn install() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        let _all_files_whole = WRITING.write();
        std::process::exit(130);
    })
}

/// Runs a closure that writes a file; the handler waits for its end.
pub fn whole<T>(write: impl FnOnce() -> T) -> T {
    let _writing = WRITING.read();
    write()
}
