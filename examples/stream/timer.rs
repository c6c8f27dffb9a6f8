//! A timer for futures: Bevy's tasks have none, and a task that slept would keep a thread from loading.
//!
//! In: moments. Out: futures that end at them, woken by one thread, which runs as long as the program.

use std::collections::BTreeMap;
use std::future::poll_fn;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Poll, Waker};
use std::thread;
use std::time::Instant;

/// Wakes futures. Clones share the thread.
#[derive(Clone)]
pub struct Timer(Arc<Shared>);

#[derive(Default)]
struct Shared {
    alarms: Mutex<Alarms>,
    changed: Condvar,
}

#[derive(Default)]
struct Alarms {
    /// By moment, then by the order in which they were set.
    wakers: BTreeMap<(Instant, u64), Waker>,
    /// The number of alarms ever set.
    set: u64,
}

impl Timer {
    /// Starts the thread.
    pub fn start() -> Self {
        let shared: Arc<Shared> = Arc::default();
        let timer = Self(shared.clone());
        thread::spawn(move || shared.run());
        timer
    }

    /// Waits until a moment.
    pub async fn wait_until(&self, moment: Instant) {
        poll_fn(|context| {
            if moment <= Instant::now() {
                return Poll::Ready(());
            }
            self.0.set(moment, context.waker().clone());
            Poll::Pending
        })
        .await;
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Alarms> {
        self.alarms.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(&self, moment: Instant, waker: Waker) {
        let mut alarms = self.lock();
        alarms.set += 1;
        let number = alarms.set;
        alarms.wakers.insert((moment, number), waker);
        self.changed.notify_one();
    }

    /// Wakes each future at its moment, forever.
    fn run(&self) {
        let mut alarms = self.lock();
        loop {
            let next = alarms.wakers.first_key_value().map(|((moment, _), _)| *moment);
            let left = next.map(|moment| moment.saturating_duration_since(Instant::now()));
            alarms = match left {
                Some(left) if left.is_zero() => {
                    if let Some((_, waker)) = alarms.wakers.pop_first() {
                        waker.wake();
                    }
                    alarms
                }
                Some(left) => self.changed.wait_timeout(alarms, left).unwrap_or_else(PoisonError::into_inner).0,
                None => self.changed.wait(alarms).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }
}
