//! Pictures of all Gaussians from many directions, at one size on the screen. Levels are trained on them and compared
//! with them.
//!
//! In: the bounding sphere of a capture, a size in pixels, numbers of directions and times. Out: [`Look`]s. Each has
//! two pictures: the truth, which is a picture of many times as many pixels, averaged to the size, and the picture
//! drawn at the size. For a level, its [`Closeness`] to all Gaussians.

use super::DetailError;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::measure::metrics::decibels;
use crate::offline::work::{Progress, proceed};
use crate::renderer::{GpuCapture, Headless};
use crate::scene::detail::pixels_across;
use crate::scene::{Bounds, RuntimeScene};
use crate::view::{Background, Camera, Frame, Optics, Picture, View};
use glam::{UVec2, Vec2, Vec3};
use serde::Serialize;

/// Distance of the cameras from the center of the sphere, radii.
const DISTANCE: f32 = 10.0;
/// Least distance of the cameras from the sphere, distances of the near plane.
const NEAREST: f32 = 5.0;
/// Pixels around the sphere.
const MARGIN: u32 = 2;
/// Least number of pixels across the sphere in the pictures that are averaged to the truth: about as many as in
/// training.
pub(super) const FINE: f32 = 512.0;
/// Bytes for each pixel of a look: color and transmittance of two frames.
const FRAMES: u64 = 2 * 16;
/// Number of pixels of the screen whose change is measured.
const SCREEN: f64 = 1280.0 * 720.0;
/// Black, so that the picture has the color of the Gaussians alone.
const BLACK: Background = Background::Color([0.0; 3]);

/// The bounding sphere of a capture, capture units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sphere {
    pub bounds: Bounds,
    pub center: Vec3,
    pub radius: f32,
    /// The first and the last timestamp that is shown.
    pub shown: [f32; 2],
    /// Distance of the near plane, capture units.
    pub near: f32,
}

/// The directions and times of the views.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around {
    /// Number of directions.
    pub directions: usize,
    /// Number of times of each direction.
    pub times: usize,
    /// Shift of all directions and times, 0 to 1 of the distance between two. A different shift has different views.
    pub shift: f32,
}

/// A view with two pictures of all Gaussians.
pub(super) struct Look {
    /// The view, without anti-aliasing.
    pub view: View,
    /// A picture of all Gaussians with more pixels, averaged to this size.
    truth: Frame,
    /// All Gaussians, drawn at this size.
    all: Frame,
    /// Mean square error between these two.
    missing: f64,
    /// The first corner of the rectangle of the capture, and the corner beyond its last pixel.
    rectangle: [UVec2; 2],
}

/// The PSNR of a level at one size on the screen; each value is that of the worst view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Closeness {
    /// The size, pixels.
    pub pixels: f32,
    /// PSNR of the level against all Gaussians, drawn at this size, over a screen of 1280x720 pixels, dB; at most
    /// [`MAX_PSNR`](crate::offline::measure::metrics::MAX_PSNR).
    pub screen: f64,
    /// PSNR of the level against the truth inside the rectangle of the capture, dB.
    pub truth: f64,
    /// PSNR of all Gaussians, drawn at this size, against the truth inside the rectangle of the capture, dB.
    pub all: f64,
}

impl Sphere {
    /// Returns the bounding sphere of a capture, the same as in Bevy apps; `None` if nothing is drawn.
    pub(super) fn of(scene: &RuntimeScene) -> Option<Self> {
        let [first, last] = scene.trained_with.time_interval;
        // A still is drawn at its first timestamp only.
        let shown = if scene.playback.duration_seconds > 0.0 { [first, last] } else { [first, first] };
        let bounds = Bounds::of(scene.iter(), shown, scene.trained_with.marginal_cutoff, scene.filter.as_ref())?;
        let (center, radius) = (bounds.center(), bounds.radius());
        let near = scene.trained_with.near;
        (center.is_finite() && radius.is_finite() && radius > 0.0).then_some(Self {
            bounds,
            center,
            radius,
            shown,
            near,
        })
    }

    /// Returns the view from a direction (of length 1, away from the center) in which the sphere is `pixels` pixels
    /// across.
    fn view(&self, direction: Vec3, time: f32, pixels: f32) -> View {
        let distance = (DISTANCE * self.radius).max(self.radius + NEAREST * self.near);
        let side = pixels.ceil() as u32 + 2 * MARGIN;
        let focal = pixels / pixels_across(self.radius, distance, 1.0);
        let fov = 2.0 * (side as f32 / (2.0 * focal)).atan();
        let up = if direction.z.abs() > 0.9 { Vec3::X } else { Vec3::Z };
        let eye = self.center + direction * distance;
        let optics = Optics { near: self.near, ..Optics::default() };
        Camera::look_at(eye, self.center, up, fov, UVec2::splat(side)).view(time, optics)
    }
}

impl Around {
    /// Returns each direction at each of its times.
    fn all(&self, [first, last]: [f32; 2]) -> impl Iterator<Item = (Vec3, f32)> {
        // A spiral with the golden angle covers the sphere evenly.
        let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
        let Self { directions, times, shift } = *self;
        (0..directions).flat_map(move |place| {
            let z = 1.0 - 2.0 * (place as f32 + 0.5) / directions as f32;
            let angle = golden * (place as f32 + shift);
            let flat = (1.0 - z * z).max(0.0).sqrt();
            let direction = Vec3::new(flat * angle.cos(), flat * angle.sin(), z);
            let part = move |k: usize| (k as f32 + 0.5 * shift + 0.25) / times as f32;
            (0..times).map(move |k| (direction, first + (last - first) * part(k)))
        })
    }
}

/// Draws all Gaussians, whose training pixel is given, from all directions at each of these sizes, pixels. Begins the
/// task "looking".
pub(super) fn looks(
    headless: &mut Headless,
    capture: &GpuCapture,
    sphere: &Sphere,
    trained_pixel: Option<f32>,
    around: Around,
    sizes: &[f32],
    progress: &mut dyn Progress,
) -> Result<Vec<Vec<Look>>, DetailError> {
    // Frames of all sizes together have less than three times the pixels of the largest.
    let largest = sizes.iter().copied().fold(0.0, f32::max).ceil() as u32 + 2 * MARGIN;
    let views = (around.directions * around.times) as u64;
    Pictures::frames(UVec2::splat(largest), views, 3 * FRAMES).require(Some(&*headless), Purpose::Directions)?;
    progress.begin("looking", sizes.len());
    let mut all = Vec::with_capacity(sizes.len());
    for &pixels in sizes {
        let mut own = Vec::new();
        for (direction, time) in around.all(sphere.shown) {
            proceed(progress)?;
            let view = sphere.view(direction, time, pixels);
            let shown = view.antialiased(trained_pixel);
            let mut all = headless.render(capture, &shown, BLACK)?;
            // Depths are not compared.
            (all.depth, all.median_depth) = (Vec::new(), Vec::new());
            let times = (FINE / pixels).ceil().max(1.0) as u32;
            let fine = headless.render(capture, &View { size: shown.size * times, ..shown }, BLACK)?;
            let (truth, rectangle) = (shrunk(&fine, times), rectangle(&view, &sphere.bounds));
            let missing = square_error(&truth, &all, rectangle);
            own.push(Look { view, truth, all, missing, rectangle });
        }
        all.push(own);
        progress.advance();
    }
    progress.finish();
    Ok(all)
}

impl Look {
    /// Returns the frame that a level is trained on: the mean of the truth and of all Gaussians drawn at this size.
    pub(super) fn target(&self) -> Frame {
        let mut mean = self.truth.clone();
        for (pixel, other) in mean.picture.pixels.iter_mut().zip(&self.all.picture.pixels) {
            *pixel = (*pixel + *other) * 0.5;
        }
        for (left, other) in mean.transmittance.iter_mut().zip(&self.all.transmittance) {
            *left = (*left + *other) * 0.5;
        }
        mean
    }
}

/// Returns a frame of which each pixel is the mean of `times` x `times` pixels.
fn shrunk(fine: &Frame, times: u32) -> Frame {
    let (size, width) = (fine.picture.size / times, fine.picture.size.x);
    let (mut pixels, mut transmittance) = (Vec::new(), Vec::new());
    let share = 1.0 / (times * times) as f32;
    for (y, x) in (0..size.y).flat_map(|y| (0..size.x).map(move |x| (y, x))) {
        let (mut color, mut left) = (Vec3::ZERO, 0.0);
        for row in 0..times {
            let first = ((y * times + row) * width + x * times) as usize;
            let own = first..first + times as usize;
            color += fine.picture.pixels[own.clone()].iter().sum::<Vec3>();
            left += fine.transmittance[own].iter().sum::<f32>();
        }
        pixels.push(color * share);
        transmittance.push(left * share);
    }
    let picture = Picture { size, pixels };
    Frame { picture, transmittance, depth: Vec::new(), median_depth: Vec::new(), counts: fine.counts }
}

/// Returns the closeness of a level in views of one size. `trained_pixel` is that of the level.
pub(super) fn closeness(
    headless: &mut Headless,
    level: &GpuCapture,
    trained_pixel: Option<f32>,
    pixels: f32,
    looks: &[Look],
) -> Result<Closeness, DetailError> {
    let farthest = f64::INFINITY;
    let mut close = Closeness { pixels, screen: farthest, truth: farthest, all: farthest };
    for look in looks {
        let frame = headless.render(level, &look.view.antialiased(trained_pixel), BLACK)?;
        let inside = (look.rectangle[1] - look.rectangle[0]).as_dvec2();
        let between = |a, b| square_error(a, b, look.rectangle);
        let share = inside.x * inside.y / SCREEN;
        close.screen = close.screen.min(decibels(between(&look.all, &frame) * share));
        close.truth = close.truth.min(decibels(between(&look.truth, &frame)));
        close.all = close.all.min(decibels(look.missing));
    }
    Ok(close)
}

/// Returns the mean square error between two frames inside a rectangle, over black or over white, whichever is larger;
/// values are clamped to 0..1.
fn square_error(a: &Frame, b: &Frame, [low, high]: [UVec2; 2]) -> f64 {
    let width = a.picture.size.x;
    let over = |frame: &Frame, at: usize, behind: f32| {
        (frame.picture.pixels[at] + frame.transmittance[at] * behind).clamp(Vec3::ZERO, Vec3::ONE)
    };
    let (mut squares, mut count) = ([0.0; 2], 0u32);
    for at in (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| (y * width + x) as usize)) {
        for (sum, behind) in squares.iter_mut().zip([0.0, 1.0]) {
            *sum += f64::from((over(a, at, behind) - over(b, at, behind)).length_squared());
        }
        count += 3;
    }
    squares[0].max(squares[1]) / f64::from(count.max(1))
}

/// Returns the rectangle of a box in a view: its first corner, and the corner beyond its last pixel. It has at least
/// one pixel.
fn rectangle(view: &View, bounds: &Bounds) -> [UVec2; 2] {
    let [row_x, row_y] = view.clip_rows();
    let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for corner in 0..8 {
        let side = |axis: usize| if corner >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        let point = Vec3::new(side(0), side(1), side(2));
        let depth = view.world_to_camera.transform_point3(point).z;
        let ndc = Vec2::new(row_x.dot(point.extend(1.0)), row_y.dot(point.extend(1.0))) / depth;
        let place = (ndc + 1.0) * 0.5 * view.size.as_vec2();
        (low, high) = (low.min(place), high.max(place));
    }
    let last = view.size - 1;
    let low = low.floor().max(Vec2::ZERO).as_uvec2().min(last);
    [low, high.ceil().max(Vec2::ZERO).as_uvec2().clamp(low + 1, view.size)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::NEAR;

    fn sphere() -> Sphere {
        let bounds = Bounds { min: Vec3::new(-1.0, -0.5, 0.0), max: Vec3::new(1.0, 0.5, 2.0) };
        Sphere { bounds, center: bounds.center(), radius: bounds.radius(), shown: [0.0, 1.0], near: NEAR }
    }

    #[test]
    fn the_sphere_has_the_requested_size_on_the_screen() {
        let sphere = sphere();
        for pixels in [4.0, 50.0, 300.0] {
            let view = sphere.view(Vec3::new(0.6, 0.0, 0.8), 0.0, pixels);
            let distance = view.camera_position.distance(sphere.center);
            let focal = view.focal().x;
            assert!((pixels_across(sphere.radius, distance, focal) - pixels).abs() < 1e-3 * pixels, "{pixels} pixels");
        }
    }

    #[test]
    fn a_shrunk_frame_is_the_mean_of_its_pixels() {
        let size = UVec2::new(4, 2);
        let pixels: Vec<Vec3> = (0..8).map(|at| Vec3::splat(at as f32)).collect();
        let transmittance = vec![0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
        let counts = crate::view::Counts::default();
        let picture = Picture { size, pixels };
        let fine = Frame { picture, transmittance, depth: Vec::new(), median_depth: Vec::new(), counts };
        let small = shrunk(&fine, 2);
        assert_eq!(small.picture.size, UVec2::new(2, 1), "half of each side");
        assert_eq!(small.picture.pixels, [Vec3::splat(2.5), Vec3::splat(4.5)], "each color is the mean of four");
        assert_eq!(small.transmittance, [0.5, 1.0], "each transmittance is the mean of four");
    }

    #[test]
    fn the_rectangle_contains_the_box_and_is_little_larger() {
        let view = sphere().view(Vec3::Y, 0.0, 100.0);
        let [low, high] = rectangle(&view, &sphere().bounds);
        let size = (high - low).as_vec2();
        // 2 x 2 units, of which the sphere of radius 1.5 is three across.
        assert!(
            (60.0..80.0).contains(&size.x) && (60.0..80.0).contains(&size.y),
            "the rectangle has about two thirds of the sphere's size: {low} to {high}"
        );
        assert!(low.cmpge(UVec2::ONE).all() && high.cmplt(view.size).all(), "the rectangle is inside the picture");
    }

    #[test]
    fn directions_cover_the_sphere_and_a_shift_changes_all_of_them() {
        let around = Around { directions: 40, times: 3, shift: 0.0 };
        let all: Vec<(Vec3, f32)> = around.all([2.0, 4.0]).collect();
        assert_eq!(all.len(), 120, "there is a view for each direction and time");
        let middle = all.iter().map(|(direction, _)| *direction).sum::<Vec3>() / 120.0;
        assert!(middle.length() < 0.1, "the mean of the directions is near zero: {middle}");
        assert!(all.iter().all(|(_, time)| (2.0..4.0).contains(time)), "the times are within the interval");
        let other = Around { shift: 0.5, ..around };
        assert!(
            other.all([2.0, 4.0]).zip(&all).all(|(a, b)| a.0 != b.0 && a.1 != b.1),
            "no shifted direction or time is the same"
        );
    }
}
