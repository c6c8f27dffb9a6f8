//! The section "playback": the time of one capture.
//!
//! In: the capture's [`Playback`], duration and key-frames. Out: the edited playback.

use super::listed::Listed;
use super::presentation::mark_positions;
use crate::plugin::component::GaussianCapture;
use crate::plugin::playback::{Playback, Repeat};
use bevy_egui::egui;
use egui::{DragValue, Slider, SliderClamping};
use std::ops::RangeInclusive;

/// Width of the number next to a slider, points.
const NUMBER_WIDTH: f32 = 76.0;
/// Height of the strip of key-frame marks, points.
const STRIP_HEIGHT: f32 = 10.0;

/// Draws the section. `fps` is the frame rate of the step buttons, in frames per second.
pub(super) fn show(ui: &mut egui::Ui, playback: Playback, capture: &GaussianCapture, fps: &mut f32) -> Playback {
    let mut edited = playback;
    let duration = capture.duration_seconds();
    if duration == 0.0 {
        ui.weak("a still");
        return edited;
    }
    buttons(ui, &mut edited, duration, fps);
    scrub(ui, &mut edited, capture, duration);
    pace(ui, &mut edited);
    range(ui, &mut edited, duration);
    edited
}

fn buttons(ui: &mut egui::Ui, playback: &mut Playback, duration: f32, fps: &mut f32) {
    ui.horizontal(|ui| {
        if ui.button(if playback.playing { "pause" } else { "play" }).clicked() {
            playback.toggle();
        }
        if ui.button("replay").clicked() {
            playback.replay();
        }
        if ui.button("back").on_hover_text("one frame back").clicked() {
            playback.step(-1, *fps, duration);
        }
        if ui.button("next").on_hover_text("one frame forward").clicked() {
            playback.step(1, *fps, duration);
        }
        let rate = DragValue::new(fps).range(1.0..=240.0).clamp_existing_to_range(false);
        ui.add(rate.speed(0.25).max_decimals(2).suffix(" fps"))
            .on_hover_text("frame rate of the steps, in frames per second");
    });
}

/// Draws the time slider below the marks of the key-frames.
fn scrub(ui: &mut egui::Ui, playback: &mut Playback, capture: &GaussianCapture, duration: f32) {
    ui.scope(|ui| {
        ui.spacing_mut().slider_width = (ui.available_width() - NUMBER_WIDTH).max(40.0);
        strip(ui, playback, capture, duration);
        let mut time = if playback.time.is_nan() { 0.0 } else { playback.time };
        let slider = Slider::new(&mut time, 0.0..=duration).clamping(SliderClamping::Edits);
        if ui.add(slider.min_decimals(2).max_decimals(3).suffix(" s")).changed() {
            playback.seek(time);
        }
    });
}

/// Draws the played range and the filter's key-frames above the slider's rail.
fn strip(ui: &mut egui::Ui, playback: &Playback, capture: &GaussianCapture, duration: f32) {
    let size = egui::vec2(ui.spacing().slider_width, STRIP_HEIGHT);
    let (bounds, response) = ui.allocate_exact_size(size, egui::Sense::hover());
    let rail = bounds.x_range().shrink(handle_inset(ui));
    let range = [within(playback.start, 0.0, duration), within(playback.end, duration, duration)];
    if let [from, to] = mark_positions(range.into_iter(), duration, rail.min, rail.max)[..] {
        let played = egui::Rect::from_x_y_ranges(from..=to, bounds.y_range());
        ui.painter().rect_filled(played, 2.0, ui.visuals().extreme_bg_color);
    }
    let Some(key_frames) = capture.key_frames() else { return };
    let ink = ui.visuals().weak_text_color();
    for x in mark_positions(key_frames.times(), duration, rail.min, rail.max) {
        ui.painter().vline(x, bounds.y_range(), (1.0, ink));
    }
    response.on_hover_text(format!("{} key-frames", key_frames.count()));
}

/// Returns the distance between the end of a slider and the middle of its handle there, in points.
fn handle_inset(ui: &egui::Ui) -> f32 {
    let height = ui.text_style_height(&egui::TextStyle::Body).max(ui.spacing().interact_size.y);
    let radius = height / 2.5;
    match ui.visuals().handle_shape {
        egui::style::HandleShape::Circle => radius,
        egui::style::HandleShape::Rect { aspect_ratio } => radius * aspect_ratio,
    }
}

fn pace(ui: &mut egui::Ui, playback: &mut Playback) {
    ui.horizontal(|ui| {
        let speed = Slider::new(&mut playback.speed, -2.0..=2.0).clamping(SliderClamping::Edits);
        ui.add(speed.max_decimals(2).text("speed"));
        if ui.button("reverse").clicked() {
            playback.reverse();
        }
    });
    ui.horizontal(|ui| {
        for &repeat in Repeat::ALL {
            ui.selectable_value(&mut playback.repeat, repeat, repeat.name());
        }
    });
}

/// Draws the in and the out point.
fn range(ui: &mut egui::Ui, playback: &mut Playback, duration: f32) {
    ui.horizontal(|ui| {
        let mut start = within(playback.start, 0.0, duration);
        let mut end = within(playback.end, duration, duration);
        ui.label("from");
        if ui.add(seconds(&mut start, 0.0..=end)).changed() {
            playback.start = start;
        }
        ui.label("to");
        if ui.add(seconds(&mut end, start..=duration)).changed() {
            playback.end = end;
        }
        if ui.button("whole").clicked() {
            (playback.start, playback.end) = (0.0, f32::INFINITY);
        }
    });
}

fn seconds(value: &mut f32, range: RangeInclusive<f32>) -> DragValue<'_> {
    DragValue::new(value).range(range).clamp_existing_to_range(false).speed(0.01).max_decimals(3).suffix(" s")
}

/// Returns one end of the range in seconds, clamped to the capture. NaN becomes `own`, the capture's own end.
fn within(seconds: f32, own: f32, duration: f32) -> f32 {
    if seconds.is_nan() { own } else { seconds.clamp(0.0, duration) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{FilterKind, GaussianScene, TemporalFilter};
    use egui::{Event, Modifiers, PointerButton, Pos2};

    const COUNT: usize = 20;

    fn capture(duration_seconds: f32) -> GaussianCapture {
        let settings = SynthSettings { count: COUNT, degree: 0, duration_seconds, ..SynthSettings::default() };
        let filter = TemporalFilter::from_bits(FilterKind::Support, 4, COUNT, vec![u32::MAX >> (32 - COUNT); 4]);
        let scene = GaussianScene { filter: Some(filter), ..synthesize(&settings) };
        GaussianCapture::new(scene.into_runtime().expect("a synthetic scene can be drawn"))
    }

    /// Draws the section once while `events` happen. Returns the playback as edited.
    fn pass(context: &egui::Context, events: Vec<Event>, playback: Playback, capture: &GaussianCapture) -> Playback {
        let screen = egui::Rect::from_min_size(Pos2::ZERO, egui::vec2(320.0, 240.0));
        let input = egui::RawInput { screen_rect: Some(screen), events, ..egui::RawInput::default() };
        let mut edited = playback;
        let output = context.run_ui(input, |ui| edited = show(ui, edited, capture, &mut 30.0));
        output.drop_without_applying_deltas();
        edited
    }

    #[test]
    fn drawing_the_section_changes_no_playback() {
        let odd = Playback { time: 0.123_45, speed: 7.123_4, start: 0.1, end: 1.234_5, ..Playback::default() };
        let outside = Playback { time: 9.0, start: -1.0, end: 5.0, ..Playback::default() };
        let inverted = Playback { time: -3.0, start: 1.5, end: 0.5, ..Playback::default() };
        let context = egui::Context::default();
        for playback in [Playback::default(), odd, outside, inverted] {
            for duration in [2.0, 0.0] {
                for _ in 0..3 {
                    let edited = pass(&context, Vec::new(), playback, &capture(duration));
                    assert_eq!(edited, playback, "drawing the section of a capture of {duration} s changes nothing");
                }
            }
        }
    }

    #[test]
    fn the_first_button_pauses_and_plays() {
        let (context, capture) = (egui::Context::default(), capture(2.0));
        let pos = Pos2::new(10.0, 8.0);
        let button = |pressed| {
            let (button, modifiers) = (PointerButton::Primary, Modifiers::default());
            vec![Event::PointerButton { pos, button, pressed, modifiers }]
        };
        let mut playback = Playback::default();
        for playing in [false, true] {
            for events in [vec![Event::PointerMoved(pos)], button(true), button(false)] {
                playback = pass(&context, events, playback, &capture);
            }
            assert_eq!(
                playback,
                Playback { playing, ..Playback::default() },
                "a click toggles playing and changes no other field"
            );
        }
    }

    #[test]
    fn the_shown_ends_of_the_range_are_clamped_to_the_capture() {
        assert_eq!(within(f32::INFINITY, 2.0, 2.0), 2.0, "an infinite end is the capture's end");
        assert_eq!(within(-1.0, 0.0, 2.0), 0.0, "a negative start is the capture's start");
        assert_eq!(within(f32::NAN, 2.0, 2.0), 2.0, "NaN is the capture's own end");
    }
}
