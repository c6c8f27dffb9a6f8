//! Pauses of a long task: in a browser all tasks run on the thread of the page, which draws and answers in a pause.
//! Elsewhere the other tasks of the thread have their turn.
//!
//! In: the steps of a task. Out: after some of them, a pause.

/// Steps between two pauses: 1 MiB of work with [`Loading::STEP`](crate::codec::Loading::STEP), a frame or two on a
/// slow machine. Pauses after every step would take longer than the work: a browser makes each at least 4 ms long.
const STEPS: u32 = 16;

/// The pauses of a task.
#[derive(Debug, Default)]
pub(super) struct Pauses {
    /// Steps since the last pause.
    steps: u32,
}

impl Pauses {
    /// Counts a step, and pauses after every [`STEPS`].
    pub(super) async fn after_step(&mut self) {
        self.steps += 1;
        if self.steps == STEPS {
            self.steps = 0;
            pause().await;
        }
    }
}

#[cfg(not(target_arch = "wasm32"))]
async fn pause() {
    bevy::tasks::futures_lite::future::yield_now().await;
}

#[cfg(target_arch = "wasm32")]
async fn pause() {
    use js_sys::{Function, Promise, Reflect, global};
    let turn = Promise::new(&mut |resolve, _| {
        let timer = Reflect::get(&global(), &"setTimeout".into()).map(Function::from);
        // A program that embeds no page may have no timer.
        if timer.and_then(|timer| timer.call1(&global(), &resolve)).is_err() {
            let _ = resolve.call0(&global());
        }
    });
    // The promise is never rejected.
    let _ = wasm_bindgen_futures::JsFuture::from(turn).await;
}
