//! The section "GPU time": the time of each pass.
//!
//! In: whether the section is open, the measured passes, the size below which a budget leaves out Gaussians. Out: bars.
//! The panel measures only while the section is open, because measuring takes time itself.

use super::counts::bar;
use super::presentation::fraction;
use crate::plugin::render::CaptureStatistics;
use crate::renderer::PassTime;
use bevy_egui::egui;

/// Number of frames without a measurement after which the panel reports that the GPU has no timestamps.
const MOST_FRAMES_WAITED: u32 = 60;

/// Whether the panel measures, and for how many frames without a result.
#[derive(Debug, Default)]
pub(super) struct Measuring {
    on: bool,
    waited: u32,
}

impl Measuring {
    /// Measures from the opening to the closing of the section. Measurements that the game has started continue.
    pub(super) fn follow(&mut self, open: bool, statistics: &CaptureStatistics) {
        if self.on != open {
            *self = Self { on: open, waited: 0 };
            statistics.measure_for_panel(open);
        }
    }
}

/// Draws the section of a view that draws captures.
pub(super) fn show(ui: &mut egui::Ui, passes: &[PassTime], cut: f32, measuring: &mut Measuring) {
    if passes.is_empty() {
        measuring.waited = measuring.waited.saturating_add(1);
        let waits = measuring.waited <= MOST_FRAMES_WAITED;
        ui.weak(if waits { "measuring ..." } else { "not measured: this GPU has no timestamps" });
        return;
    }
    let sum: f64 = passes.iter().map(|pass| pass.milliseconds).sum();
    for pass in passes {
        bar(ui, fraction(pass.milliseconds, sum), format!("{}: {:.3} ms", pass.name, pass.milliseconds));
    }
    ui.label(format!("sum: {sum:.3} ms"));
    if cut > 0.0 {
        ui.label(format!("budget: left out below {cut:.3} px"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::Measured;

    #[test]
    fn closing_the_section_does_not_stop_measurements_of_the_game() {
        let (statistics, mut panel) = (CaptureStatistics::default(), Measuring::default());
        statistics.measure(true);
        for open in [true, false] {
            panel.follow(open, &statistics);
            assert_eq!(statistics.measured(), Measured::Passes, "the game's measurement continues, open: {open}");
        }
        statistics.measure(false);
        assert_eq!(statistics.measured(), Measured::Nothing, "measuring ends when the game stops it");
        for open in [true, false] {
            panel.follow(open, &statistics);
            assert_eq!(
                statistics.measured() == Measured::Passes,
                open,
                "the panel measures only while the section is open"
            );
        }
    }
}
