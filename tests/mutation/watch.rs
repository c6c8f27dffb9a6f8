//! A reader run on one input, with limits.
//!
//! In: a reader and the bytes to read. Out: the outcome ([`Seen`]): refused or accepted, or a defect: a panic in any
//! thread, caught or not, too much time or memory, a message with control characters, or a defect that the reader finds
//! in its result.
//!
//! Each input is read on its own thread with a stack of the usual size: endless recursion ends the process, and the
//! message of the system names the thread, which is named after the input.

use crate::memory;
use crate::readers::{Outcome, Reader};
use std::mem;
use std::panic::{self, AssertUnwindSafe};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Stack of the thread that reads: the default of Rust, which threads that load assets have, too.
const STACK: usize = 2 << 20;
/// The longest time that an input may take, including the checks of an accepted result.
const TIME: Duration = Duration::from_secs(2);
/// The most often that an input is read which takes longer.
const ATTEMPTS: usize = 3;
/// Time after which an input is given up.
const STUCK: Duration = Duration::from_secs(60);
/// The most memory that an input may take, bytes.
const MEMORY: usize = 1 << 30;
/// The most memory that may be asked for at once, bytes.
const REQUEST: usize = 512 << 20;

/// The panics since an input began.
static PANICS: Mutex<Panics> = Mutex::new(Panics { count: 0, first: None });

/// Panics of any thread.
#[derive(Default)]
struct Panics {
    count: usize,
    /// The message of the first.
    first: Option<String>,
}

/// The outcome of an input.
pub struct Seen {
    /// The outcome, or the defect.
    pub outcome: Result<Outcome, String>,
    pub time: Duration,
    /// Bytes, at the peak.
    pub memory: usize,
    /// Whether it is still running, so that further measurements are not valid.
    pub stuck: bool,
}

/// Has panics of all threads but the main one counted instead of printed.
pub fn record_panics() {
    let usual = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if thread::current().name() == Some("main") {
            return usual(info);
        }
        let mut panics = PANICS.lock().unwrap_or_else(PoisonError::into_inner);
        panics.count += 1;
        panics.first.get_or_insert_with(|| info.to_string().replace('\n', " "));
    }));
}

/// Takes the panics since the last call: the message of the first, and their number if there were several.
fn take_panics() -> Option<String> {
    let Panics { count, first } = mem::take(&mut *PANICS.lock().unwrap_or_else(PoisonError::into_inner));
    first.map(|first| if count > 1 { format!("{count} panics, the first: {first}") } else { first })
}

/// Runs a reader on an input. `name` is the name of the input. An input that takes too long is read again, because
/// other programs may have taken the processor: the shortest time counts.
pub fn watch(name: &str, reader: &Arc<dyn Reader>, bytes: &Arc<[u8]>) -> Seen {
    let mut seen = watch_once(name, reader, bytes);
    for _ in 1..ATTEMPTS {
        if seen.stuck || seen.time <= TIME {
            break;
        }
        let again = watch_once(name, reader, bytes);
        if again.stuck || again.time < seen.time {
            seen = again;
        }
    }
    seen
}

fn watch_once(name: &str, reader: &Arc<dyn Reader>, bytes: &Arc<[u8]>) -> Seen {
    let (sender, receiver) = mpsc::channel();
    let (reader, bytes) = (Arc::clone(reader), Arc::clone(bytes));
    take_panics();
    memory::begin();
    let start = Instant::now();
    let read = move || {
        let outcome = panic::catch_unwind(AssertUnwindSafe(|| reader.read(&bytes)));
        // The receiver is gone if the input was given up.
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
    let outcome = match (received, take_panics()) {
        _ if stuck => Err(format!("still runs after {} s", STUCK.as_secs())),
        // Also if the panic was caught, or ended a thread whose result is ignored.
        (_, Some(panics)) => Err(panics),
        (Ok(Some(outcome)), None) => outcome.and_then(|outcome| within_bounds(outcome, time, peak, largest)),
        (_, None) => Err("panicked without a message".to_owned()),
    };
    Seen { outcome, time, memory: peak, stuck }
}

/// Returns the outcome if it is within the limits of time and memory.
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
