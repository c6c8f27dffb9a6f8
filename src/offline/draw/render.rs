//! Drawing many views of one capture while earlier pictures are still being written.
//!
//! In: a capture on the GPU, views of it, a function that writes a picture. Out: the [`Counts`] of each view.

use super::{DrawError, Shot};
use crate::offline::engine::EngineError;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::work::{Progress, proceed};
use crate::renderer::{GpuCapture, Headless};
use crate::view::{Background, Counts, Picture, View};
use rayon::prelude::*;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;

/// Most pictures that wait to be written.
const QUEUE: usize = 4;

/// Draws the views in order, each with its shot, while other threads call `write` on the pictures. Returns the counts
/// of each view. Begins the task "rendering".
///
/// # Errors
/// Pictures that do not fit the memory, a failure of the GPU, threads that cannot be started, and errors of `write`.
pub(crate) fn render_shots(
    headless: &mut Headless,
    capture: &GpuCapture,
    background: Background,
    views: &[(Shot, View)],
    write: impl Fn(&Shot, &Picture) -> Result<(), DrawError> + Sync,
    progress: &mut dyn Progress,
) -> Result<Vec<Counts>, DrawError> {
    // One picture is being drawn and one written while the queue is full.
    let waiting = views.len().min(QUEUE + 2) as u64;
    Pictures::written(views.iter().map(|(_, view)| view.size), waiting).require(Some(&*headless), Purpose::Drawn)?;
    let (queue, drawn) = sync_channel::<(&Shot, Picture)>(QUEUE);
    // A separate thread pool: threads that wait for pictures would block the shared pool of rayon.
    let writers = rayon::ThreadPoolBuilder::new().build()?;
    thread::scope(|scope| {
        let written = scope.spawn(|| {
            let write = |(shot, picture): (&Shot, Picture)| write(shot, &picture);
            writers.install(|| drawn.into_iter().par_bridge().try_for_each(write))
        });
        let counts = draw(headless, capture, background, views, queue, progress);
        let written = written.join().unwrap_or(Err(DrawError::WritersPanicked));
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
) -> Result<Vec<Counts>, DrawError> {
    progress.begin("rendering", views.len());
    let mut counts = Vec::with_capacity(views.len());
    for (shot, view) in views {
        proceed(progress)?;
        let frame = headless.render(capture, view, background).map_err(EngineError::from)?;
        counts.push(frame.counts);
        if queue.send((shot, frame.picture)).is_err() {
            // The writers have stopped at an error, which they return.
            break;
        }
        progress.advance();
    }
    progress.finish();
    Ok(counts)
}
