//! The chart of a timeline: its clips, key-frames, markers and playhead.
//!
//! In: a timeline, its captures, the key-frames of an animation. Out: bars, marks and flags in an egui panel, and the
//! time under the pointer.

use bevy::prelude::*;
use bevy_egui::egui::{Align2, Color32, FontId, Painter, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};
use bevy_gs4d::playback::{Clip, Timeline};
use bevy_gs4d::prelude::GaussianCapture;

const WIDTH: f32 = 720.0;
const LABELS: f32 = 56.0;
const ROW: f32 = 26.0;

/// The contents of the chart.
pub struct Chart<'a> {
    pub timeline: &'a Timeline,
    pub captures: &'a Assets<GaussianCapture>,
    /// The name of an animation that follows the timeline, and its key-frames in seconds of the timeline.
    pub animation: (&'a str, &'a [f32]),
}

/// The positions of rows and times on the screen.
struct Scale {
    bounds: Rect,
    duration: f32,
}

impl Scale {
    fn x(&self, seconds: f32) -> f32 {
        self.bounds.left() + LABELS + self.width() * seconds / self.duration
    }

    fn seconds(&self, x: f32) -> f32 {
        ((x - self.bounds.left() - LABELS) / self.width() * self.duration).clamp(0.0, self.duration)
    }

    /// Returns the bar between two times in a row; row 0 has the flags of markers.
    fn bar(&self, row: usize, from: f32, to: f32) -> Rect {
        let top = self.bounds.top() + ROW * row as f32;
        Rect::from_x_y_ranges(self.x(from)..=self.x(to), top + 2.0..=top + ROW - 2.0)
    }

    fn width(&self) -> f32 {
        self.bounds.width() - LABELS - 4.0
    }
}

impl Chart<'_> {
    /// Draws the chart with the playhead at `time`. Returns the time under the pointer while a button is down.
    pub fn show(&self, ui: &mut Ui, time: f32) -> Option<f32> {
        let tracks = self.timeline.tracks();
        let size = vec2(WIDTH, ROW * (tracks.len() as f32 + 2.0));
        let (response, painter) = ui.allocate_painter(size, Sense::click_and_drag());
        let duration = self.timeline.duration_seconds().max(f32::MIN_POSITIVE);
        let scale = Scale { bounds: response.rect, duration };
        let ground = ui.visuals().window_fill();
        let label = |row: usize, name: &str| {
            let place = pos2(scale.bounds.left(), scale.bar(row, 0.0, 0.0).center().y);
            painter.text(place, Align2::LEFT_CENTER, name, FontId::proportional(12.0), ui.visuals().text_color());
        };
        for (index, track) in tracks.iter().enumerate() {
            label(index + 1, &track.name);
            for clip in &track.clips {
                draw_clip(&painter, &scale, index + 1, clip, ground);
                marks(&painter, &scale, scale.bar(index + 1, 0.0, 0.0), &key_frames(clip, self.captures));
            }
        }
        let (name, moments) = self.animation;
        label(tracks.len() + 1, name);
        let bar = scale.bar(tracks.len() + 1, 0.0, duration);
        painter.rect_filled(bar, 3.0, Color32::DARK_GREEN);
        marks(&painter, &scale, bar, moments);
        self.draw_flags(&painter, &scale);
        painter.vline(scale.x(time), scale.bounds.y_range(), Stroke::new(2.0, Color32::WHITE));
        Some(scale.seconds(response.interact_pointer_pos()?.x))
    }

    fn draw_flags(&self, painter: &Painter, scale: &Scale) {
        for marker in self.timeline.markers() {
            let x = scale.x(marker.time);
            painter.vline(x, scale.bounds.y_range(), Stroke::new(1.0, Color32::GREEN));
            let flag = pos2(x + 3.0, scale.bounds.top());
            painter.text(flag, Align2::LEFT_TOP, &marker.name, FontId::proportional(12.0), Color32::GREEN);
        }
    }
}

/// Draws a bar with corners cut off by its fades.
fn draw_clip(painter: &Painter, scale: &Scale, row: usize, clip: &Clip, ground: Color32) {
    let bar = scale.bar(row, clip.start, clip.end());
    let color = if clip.speed < 0.0 { Color32::DARK_RED } else { Color32::DARK_BLUE };
    painter.rect_filled(bar, 3.0, color);
    let [fade_in, fade_out] = clip.fade;
    let full = [scale.x(clip.start + fade_in), scale.x(clip.end() - fade_out)];
    let corners = [(bar.left(), full[0], fade_in), (bar.right(), full[1], fade_out)];
    for (end, full, _) in corners.into_iter().filter(|(.., fade)| *fade > 0.0) {
        let corner = vec![pos2(end, bar.top()), pos2(full, bar.top()), pos2(end, bar.bottom())];
        painter.add(Shape::convex_polygon(corner, ground, Stroke::NONE));
    }
}

/// Draws short marks in the lower half of a row.
fn marks(painter: &Painter, scale: &Scale, row: Rect, moments: &[f32]) {
    for moment in moments {
        let (x, height) = (scale.x(*moment), row.center().y..=row.bottom());
        painter.vline(x, height, Stroke::new(1.0, Color32::LIGHT_YELLOW));
    }
}

/// Returns the times at which a clip shows key-frames of its capture, in seconds of the timeline.
fn key_frames(clip: &Clip, captures: &Assets<GaussianCapture>) -> Vec<f32> {
    let [first, last] = clip.range;
    let Some(key_frames) = captures.get(&clip.capture).and_then(|capture| capture.key_frames()) else {
        return Vec::new();
    };
    let begin = if clip.speed < 0.0 { last } else { first };
    let shown = key_frames.times().filter(|time| (first..=last).contains(time));
    shown.map(|time| clip.start + (time - begin) / clip.speed).collect()
}
