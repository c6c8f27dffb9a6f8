//! Progress on standard error.
//!
//! In: the tasks and notes of library calls. Out: one bar for each unfinished task, below the bar of the task that
//! contains it; one line for each note.

use super::interrupt;
use super::note::{BARS, is_silent, note, note_once};
use crate::offline::work::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// The bars of the unfinished tasks; hidden with `--json` and if standard error is not a terminal. They are removed
/// when this value is dropped. Default: no tasks.
#[derive(Default)]
pub(crate) struct Bars(Vec<(ProgressBar, &'static str)>);

impl Progress for Bars {
    fn begin(&mut self, task: &'static str, steps: usize) {
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::with_draw_target(Some(steps as u64), ProgressDrawTarget::hidden());
        let bar = bar.with_style(style).with_message(task);
        let bar = if is_silent() { bar } else { BARS.add(bar) };
        if steps > 0 {
            bar.tick();
        }
        self.0.push((bar, task));
    }

    fn advance(&mut self) {
        if let Some((bar, _)) = self.0.last() {
            bar.inc(1);
        }
    }

    fn show(&mut self, words: &str) {
        if let Some((bar, task)) = self.0.last() {
            bar.set_message(format!("{task}, {words}"));
        }
    }

    fn finish(&mut self) {
        if let Some((bar, _)) = self.0.pop() {
            bar.finish_and_clear();
        }
    }

    fn note(&mut self, line: &str) {
        let write = if line.starts_with("note: ") { note_once } else { note };
        write(line);
    }

    fn is_interrupted(&self) -> bool {
        interrupt::is_requested()
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        while !self.0.is_empty() {
            self.finish();
        }
    }
}
