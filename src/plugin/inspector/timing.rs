//! GPU time: how long each pass takes.
//!
//! In: whether the section is open, the passes that have been measured. Out: bars; and measuring switched on while the section is open,
//! because it takes some time itself.

use super::counts::bar;
use super::presentation::share;
use crate::plugin::render::CaptureStatistics;
use crate::renderer::PassTime;
use bevy_egui::egui;

/// Frames without a measurement after which the GPU is taken to have no timestamps.
const MOST_FRAMES_WAITED: u32 = 60;

/// Whether the panel measures, and for how many frames without a result.
#[derive(Debug, Default)]
pub(super) struct Measuring {
    on: bool,
    waited: u32,
}

impl Measuring {
    /// Starts measuring when the section is opened, and stops when it is closed. What the game measures stays as it is.
    pub(super) fn follow(&mut self, open: bool, statistics: &CaptureStatistics) {
        if self.on != open {
            *self = Self { on: open, waited: 0 };
            statistics.measure_for_panel(open);
        }
    }
}

/// Draws the section for a view that draws captures.
pub(super) fn show(ui: &mut egui::Ui, passes: &[PassTime], measuring: &mut Measuring) {
    if passes.is_empty() {
        measuring.waited = measuring.waited.saturating_add(1);
        let waits = measuring.waited <= MOST_FRAMES_WAITED;
        ui.weak(if waits { "measuring ..." } else { "not measured: this GPU has no timestamps" });
        return;
    }
    let sum: f64 = passes.iter().map(|pass| pass.milliseconds).sum();
    for pass in passes {
        bar(ui, share(pass.milliseconds, sum), format!("{}: {:.3} ms", pass.name, pass.milliseconds));
    }
    ui.label(format!("sum: {sum:.3} ms"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_panel_does_not_switch_off_what_the_game_measures() {
        let (statistics, mut panel) = (CaptureStatistics::default(), Measuring::default());
        statistics.measure(true);
        for open in [true, false] {
            panel.follow(open, &statistics);
            assert!(statistics.is_measuring(), "the game still measures, open: {open}");
        }
        statistics.measure(false);
        assert!(!statistics.is_measuring(), "until it stops");
        for open in [true, false] {
            panel.follow(open, &statistics);
            assert_eq!(statistics.is_measuring(), open, "then it is measured while the section is open");
        }
    }
}
