//! How a signal ends the command: INT, TERM, and HUP unless it is ignored, as under `nohup`; on systems without them
//! Ctrl-C.
//!
//! In: signals. Out: a request that the work end ([`is_requested`]); the end of the process with code 128 + signal: 130
//! after INT, 143 after TERM. Work that does not end in time, and any work after a second signal, is abandoned:
//! unfinished files are removed ([`unfinished`]), and the process ends without its exit handlers, which would run while
//! threads of the GPU driver still use what they free.

use super::note::note;
use super::report::Report;
use crate::offline::work::unfinished;
#[cfg(unix)]
use std::fs;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

/// Time within which work must end, or the reader of a pipe must read.
const PATIENCE: Duration = Duration::from_millis(300);
/// Time within which the last lines of an interrupted process must be read.
const READING: Duration = Duration::from_secs(1);
/// Time between two checks of the work.
const INTERVAL: Duration = Duration::from_millis(5);

/// The first signal; 0 before it.
static SIGNAL: AtomicI32 = AtomicI32::new(0);
/// Whether the work that runs ends with a result, for which the process waits.
static DEFERS: AtomicBool = AtomicBool::new(false);
/// Whether reports are JSON documents.
static AS_JSON: AtomicBool = AtomicBool::new(false);
/// Whether the report of the command is being printed, or has been.
static REPORTED: AtomicBool = AtomicBool::new(false);
/// Whether the command has ended: only the exit handlers are left to run.
static ENDED: AtomicBool = AtomicBool::new(false);

/// Sets the handler of signals.
///
/// # Errors
/// The operating system refuses it.
pub(crate) fn install(as_json: bool) -> io::Result<()> {
    AS_JSON.store(as_json, Ordering::SeqCst);
    unfinished::keep();
    listen()
}

#[cfg(unix)]
fn listen() -> io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    let hup = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    let mut signals = Signals::new([SIGINT, SIGTERM].into_iter().chain(hup))?;
    thread::Builder::new().name("signals".to_owned()).spawn(move || signals.forever().for_each(on_signal))?;
    Ok(())
}

/// Returns whether the process has been started with this signal ignored, where the system has the file that says so.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(not(unix))]
fn listen() -> io::Result<()> {
    /// Number of the signal that Ctrl-C is on other systems.
    const SIGINT: i32 = 2;
    ctrlc::set_handler(|| on_signal(SIGINT)).map_err(io::Error::other)
}

/// Requests that the work end; a second signal ends the process.
fn on_signal(signal: i32) {
    let is_first = SIGNAL.compare_exchange(0, signal, Ordering::SeqCst, Ordering::SeqCst).is_ok();
    // On a thread of its own, so that a second signal is noticed at any time.
    if !is_first || thread::Builder::new().spawn(move || wait(signal)).is_err() {
        leave(signal);
    }
}

/// Waits until the work has ended, which ends the process. Leaves if that takes too long.
fn wait(signal: i32) {
    if DEFERS.load(Ordering::SeqCst) {
        briefly(|| note("interrupted: the result so far is written; press Ctrl-C again to stop at once"));
    }
    let (mut before, mut since) = (doing(), Instant::now());
    loop {
        let now = doing();
        if now != before {
            (before, since) = (now, Instant::now());
        }
        let is_limited = matches!(now, Doing::Work | Doing::Stream | Doing::Report);
        if is_limited && since.elapsed() >= PATIENCE {
            leave(signal);
        }
        thread::sleep(INTERVAL);
    }
}

/// What the command does at present. The process waits without a limit only for [`Doing::Result`] and [`Doing::Exit`].
#[derive(Clone, Copy, PartialEq)]
enum Doing {
    /// Work that ends without a result.
    Work,
    /// Work that ends with a result.
    Result,
    /// Writing to a device or a pipe, whose reader may block it forever.
    Stream,
    /// Printing the report, to such a device or pipe.
    Report,
    /// Running the exit handlers.
    Exit,
}

fn doing() -> Doing {
    let is = |state: &AtomicBool| state.load(Ordering::SeqCst);
    match () {
        () if is(&ENDED) => Doing::Exit,
        () if is(&REPORTED) => Doing::Report,
        () if unfinished::is_streaming() => Doing::Stream,
        () if is(&DEFERS) => Doing::Result,
        () => Doing::Work,
    }
}

/// Removes unfinished files, prints a report if none has been printed, and ends the process.
fn leave(signal: i32) -> ! {
    let existing = unfinished::abandon(PATIENCE).unwrap_or_default();
    if !REPORTED.swap(true, Ordering::SeqCst) {
        // If it cannot be printed, the exit code still says how the command has ended.
        briefly(move || drop(Report::of_interruption(&existing).print(AS_JSON.load(Ordering::SeqCst))));
    }
    exit(signal)
}

/// Calls a function that prints on another thread, and does not wait long for it: a full pipe may have no reader.
fn briefly(print: impl FnOnce() + Send + 'static) {
    let (sender, printed) = mpsc::channel();
    let printing = thread::Builder::new().spawn(move || {
        print();
        sender.send(())
    });
    if printing.is_ok() {
        let _ = printed.recv_timeout(READING);
    }
}

/// Ends the process without exit handlers.
#[cfg(unix)]
fn exit(signal: i32) -> ! {
    signal_hook::low_level::exit(128 + signal)
}

/// Ends the process. The system ends all threads before exit handlers run.
#[cfg(not(unix))]
fn exit(signal: i32) -> ! {
    std::process::exit(128 + signal)
}

/// While this value exists, the process waits until work that was interrupted has written its result.
pub(crate) struct Deferred(());

impl Drop for Deferred {
    fn drop(&mut self) {
        DEFERS.store(false, Ordering::SeqCst);
    }
}

/// Begins work that checks [`is_requested`] regularly, and ends with a result.
pub(crate) fn defer() -> Deferred {
    DEFERS.store(true, Ordering::SeqCst);
    Deferred(())
}

/// Returns whether a signal has requested that the work end early.
pub(crate) fn is_requested() -> bool {
    SIGNAL.load(Ordering::SeqCst) != 0
}

/// Begins to print the report of the command. Does not return if [`leave`] prints a report and ends the process.
pub(crate) fn begin_report() {
    while REPORTED.swap(true, Ordering::SeqCst) {
        thread::park();
    }
}

/// Ends the handling of the first signal: the report has been printed, and its exit code is that of the process.
pub(crate) fn end_report() {
    ENDED.store(true, Ordering::SeqCst);
}

/// Ends a process whose work has ended because of a signal.
pub(crate) fn end() -> ! {
    exit(SIGNAL.load(Ordering::SeqCst))
}
