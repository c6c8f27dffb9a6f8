//! One input under watch.
//!
//! In: a reader and the bytes to read. Out: what became of them ([`Seen`]): refused or accepted, or the defect: a panic, too much time or
//! memory, a message that would change the terminal, whatever the reader itself finds wrong with what it accepted.
//!
//! Each input has a thread of its own, whose stack is that of any thread: a reader that recurses without an end ends the process, and the
//! system's message names the thread, which is named after the input.

use crate::memory;
use crate::readers::{Outcome, Reader};
use std::panic::{self, AssertUnwindSafe};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Stack of the thread that reads: what Rust gives to threads, among them those that load assets.
const STACK: usize = 2 << 20;
/// The longest that an input may take, with all that is done with what was accepted.
const TIME: Duration = Duration::from_secs(2);
/// When an input is given up.
const STUCK: Duration = Duration::from_secs(60);
/// The most memory that an input may take, bytes.
const MEMORY: usize = 1 << 30;
/// The most memory that may be asked for at once, bytes.
const REQUEST: usize = 512 << 20;

/// The first panic since an input began.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// What became of an input.
pub struct Seen {
    /// What became of it; or the defect.
    pub outcome: Result<Outcome, String>,
    pub time: Duration,
    /// Bytes, at the peak.
    pub memory: usize,
    /// Whether it still runs, so that nothing can be measured any more.
    pub stuck: bool,
}

/// Has panics of all threads but the main one kept instead of printed.
pub fn record_panics() {
    let usual = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if thread::current().name() == Some("main") {
            return usual(info);
        }
        let mut first = PANIC.lock().unwrap_or_else(PoisonError::into_inner);
        if first.is_none() {
            *first = Some(info.to_string().replace('\n', " "));
        }
    }));
}

fn last_panic() -> Option<String> {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Gives an input to a reader. `name` is that of the input.
pub fn watch(name: &str, reader: &Arc<dyn Reader>, bytes: &Arc<[u8]>) -> Seen {
    let (sender, receiver) = mpsc::channel();
    let (reader, bytes) = (Arc::clone(reader), Arc::clone(bytes));
    last_panic();
    memory::begin();
    let start = Instant::now();
    let read = move || {
        let outcome = panic::catch_unwind(AssertUnwindSafe(|| reader.read(&bytes)));
        // Nobody waits any longer for an input that was given up.
        let _ = sender.send(outcome.ok());
    };
    let builder = thread::Builder::new().name(name.to_owned()).stack_size(STACK);
    let thread = builder.spawn(read).expect("the system has room for one thread");
    let received = receiver.recv_timeout(STUCK);
    let (time, peak, largest) = (start.elapsed(), memory::peak(), memory::largest());
    let stuck = matches!(received, Err(RecvTimeoutError::Timeout));
    if !stuck {
        // A panic has been received already.
        let _ = thread.join();
    }
    let outcome = match received {
        Ok(Some(outcome)) => outcome.and_then(|outcome| within_bounds(outcome, time, peak, largest)),
        _ if stuck => Err(format!("still runs after {} s", STUCK.as_secs())),
        _ => Err(last_panic().unwrap_or_else(|| "panicked without a message".to_owned())),
    };
    Seen { outcome, time, memory: peak, stuck }
}

/// Returns the outcome if it took no more than it may.
fn within_bounds(outcome: Outcome, time: Duration, peak: usize, largest: usize) -> Result<Outcome, String> {
    if let Outcome::Refused(message) = &outcome
        && let Some(control) = message.chars().find(|c| c.is_control())
    {
        return Err(format!("the message holds the control character {control:?}: {message:?}"));
    }
    if time > TIME {
        return Err(format!("takes {:.1} s", time.as_secs_f64()));
    }
    if largest > REQUEST {
        return Err(format!("asks for {} MiB at once", largest >> 20));
    }
    if peak > MEMORY {
        return Err(format!("takes {} MiB", peak >> 20));
    }
    Ok(outcome)
}
