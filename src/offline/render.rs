//! Drawing many views of one capture while pictures drawn before are still being written.
//!
//! In: a capture on the GPU, views of it, a function that writes a picture. Out: what was drawn in each of them
//! ([`Counts`]).

use super::orbit::Shot;
use super::{OfflineError, Progress};
use crate::renderer::{GpuCapture, Headless};
use crate::view::{Background, Counts, Picture, View};
use rayon::prelude::*;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;

/// Pictures drawn but not yet written, at most.
const QUEUE: usize = 4;

/// Draws the views in order, each with the shot it belongs to, while other threads call `write` on the pictures. Begins
/// the task "rendering".
///
/// # Errors
/// A failure of the GPU, and what `write` reports.
pub fn render_shots(
    headless: &mut Headless,
    capture: &GpuCapture,
    background: Background,
    views: &[(Shot, View)],
    write: impl Fn(&Shot, &Picture) -> Result<(), OfflineError> + Sync,
    progress: &mut dyn Progress,
) -> Result<Vec<Counts>, OfflineError> {
    let (queue, drawn) = sync_channel::<(&Shot, Picture)>(QUEUE);
    // Threads of their own: they wait for pictures, which would stall rayon's shared ones.
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

/// Hands over every picture; the queue closes at the end.
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
        let frame = headless.render(capture, view, background)?;
        counts.push(frame.counts);
        if queue.send((shot, frame.picture)).is_err() {
            // The writers stopped at an error, which they report.
            break;
        }
        progress.advance();
    }
    progress.finish();
    Ok(counts)
}
