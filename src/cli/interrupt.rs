//! Ctrl-C: exits at once with code 130, but never in the middle of a file; work that can end early is asked to do so first.
//!
//! In: the closures that write files, the work that can end early. Out: files that are whole or absent. Files are written under a temporary
//! name and renamed; the handler waits until those being written are complete, so that no temporary file is left behind.

use super::note::note;
use std::process::ExitCode;
use std::sync::RwLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// The exit code of an interrupted command.
const INTERRUPTED: u8 = 130;

/// Locked for reading while a file is written, and for writing by the handler.
static WRITING: RwLock<()> = RwLock::new(());

/// Whether the work that runs can end early, and whether it has been asked to.
static DEFERS: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicBool = AtomicBool::new(false);

/// Sets the handler of SIGINT, SIGTERM and SIGHUP.
///
/// # Errors
/// The operating system refuses it.
pub fn install() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if DEFERS.load(Ordering::SeqCst) && !ASKED.swap(true, Ordering::SeqCst) {
            note("interrupted: what there is so far is written; press Ctrl-C again to stop at once");
            return;
        }
        let _all_files_whole = WRITING.write();
        std::process::exit(INTERRUPTED.into());
    })
}

/// Runs a closure that writes a file; the handler waits for its end.
pub fn whole<T>(write: impl FnOnce() -> T) -> T {
    let _writing = WRITING.read();
    write()
}

/// While this lives, the first Ctrl-C only asks the work to end early.
pub struct Deferred(());

impl Drop for Deferred {
    fn drop(&mut self) {
        DEFERS.store(false, Ordering::SeqCst);
    }
}

/// Begins work that looks at [`is_asked`] now and then.
pub fn defer() -> Deferred {
    DEFERS.store(true, Ordering::SeqCst);
    Deferred(())
}

/// Returns whether the work is asked to end early.
pub fn is_asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}

/// Returns the exit code of a command that has ended early.
pub fn exit_code() -> ExitCode {
    ExitCode::from(INTERRUPTED)
}
