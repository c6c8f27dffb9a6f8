//! A progress that interrupts a task.
//!
//! In: the name of a task and a number of steps. Out: an interruption after these steps of the task.

use bevy_gs4d::offline::work::Progress;

/// Interrupts a task at one of its steps.
pub struct Interrupting {
    task: &'static str,
    left: usize,
    /// The tasks that have begun and not finished.
    running: Vec<&'static str>,
}

impl Interrupting {
    /// Returns a progress that interrupts `task` after `left` steps.
    pub fn new(task: &'static str, left: usize) -> Self {
        Self { task, left, running: Vec::new() }
    }
}

impl Progress for Interrupting {
    fn begin(&mut self, task: &'static str, _: usize) {
        self.running.push(task);
    }

    fn advance(&mut self) {
        if self.running.last() == Some(&self.task) {
            self.left = self.left.saturating_sub(1);
        }
    }

    fn finish(&mut self) {
        self.running.pop();
    }

    fn note(&mut self, _: &str) {}

    fn is_interrupted(&self) -> bool {
        self.left == 0
    }
}
