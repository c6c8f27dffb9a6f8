//! Drawing many views of one capture while earlier pictures are still being written.
//!
//! In: a capture on the GPU, views of it, a function that writes a picture. Out: the [`Counts`] of each view.

use super::memory_check::{BY_SIZE, Pictures};
use super::orbit::Shot;
use super::{OfflineError, Progress, proceed};
use crate::renderer::{GpuCapture, Headless};
use crate::view::{Background, Counts, Picture, View};
use rayon::prelude::*;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;

/// Most pictures that wait to be written.
const QUEUE: usize = 4;

/// Draws the views in order, each with the shot it belongs to, while other threads call `write` on the pictures.
/// Returns the counts of each view. Begins the task "rendering".
///
/// # Errors
/// Pictures that do not fit the memory, a failure of the GPU, threads that cannot be started, and errors of `write`.
pub fn render_shots(
    headless: &mut Headless,
    capture: &GpuCapture,
    background: Background,
    views: &[(Shot, View)],
    write: impl Fn(&Shot, &Picture) -> Result<(), OfflineError> + Sync,
    progress: &mut dyn Progress,
) -> Result<Vec<Counts>, OfflineError> {
    // One picture is being drawn and one written while the queue is full.
    let waiting = views.len().min(QUEUE + 2) as u64;
    Pictures::written(views.iter().map(|(_, view)| view.size), waiting).require(Some(&*headless), BY_SIZE)?;
    let (queue, drawn) = sync_channel::<(&Shot, Picture)>(QUEUE);
    // A thread pool of its own: threads that wait for pictures would stall rayon's shared pool.
    let writers = rayon::ThreadPoolBuilder::new().build()?;
    thread::scope(|scope| {
        let written = scope.spawn(|| {
            let write = |(shot, picture): (&Shot, Picture)| write(shot, &picture);
            writers.install(|| drawn.into_iter().par_bridge().try_for_each(write))
        });
        let counts = draw(headless, capture, background, views, queue, progress);
        let written = written.join().unwrap_or(Err(OfflineError::WritersPanicked));
        written.and(counts)
    })
}

/// Draws every view and queues its picture; the queue closes at the end.
fn draw<'s>(
    headless: &mut Headless,
    capture: &GpuCapture,
    background: Background,
    views: &'s [(Shot, View)],
    queue: SyncSender<(&'s Shot, Picture)>,
    progress: &mut dyn Progress,
) -> Result<Vec<Counts>, OfflineError> {
    progress.begin("rendering", views.len());
    let mut counts = Vec::with_capacity(views.len());
    for (shot, view) in views {
        proceed(progress)?;
        let frame = headless.render(capture, view, background)?;
        counts.push(frame.counts);
        if queue.send((shot, frame.picture)).is_err() {
            // The writers stopped at an error, which they return.
            break;
        }
        progress.advance();
    }
    progress.finish();
    Ok(counts)
}
