//! Looks: a capture seen from all around at one size on the screen, to fit fewer Gaussians to and to compare them with.
//!
//! In: the sphere about a capture, a size in pixels, numbers of directions and times. Out: [`Look`]s with the picture of all Gaussians; how
//! close those of fewer come.

use crate::offline::{OfflineError, Progress};
use crate::renderer::{GpuCapture, Headless};
use crate::scene::{Bounds, RuntimeScene, pixels_across};
use crate::view::{Background, Camera, Frame, RasterFov, View};
use glam::{UVec2, Vec2, Vec3};

/// Distance of the cameras from the middle of the sphere, radii.
const DISTANCE: f32 = 10.0;
/// Pixels around the sphere.
const MARGIN: u32 = 2;
/// Black: color as it is, and what shows through it.
const BLACK: Background = Background::Color([0.0; 3]);

/// The sphere about the bounds of a capture, capture units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sphere {
    pub bounds: Bounds,
    pub center: Vec3,
    pub radius: f32,
}

/// Which views are taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around {
    /// Number of directions, and of times of each.
    pub directions: usize,
    pub times: usize,
    /// How far all directions and times are shifted, 0 to 1 of their distance: others are other views.
    pub shift: f32,
}

/// A view, and what all Gaussians look like in it.
pub(super) struct Look {
    pub view: View,
    pub frame: Frame,
    /// The corners of the capture's rectangle in the picture, the last one outside.
    rectangle: [UVec2; 2],
}

impl Sphere {
    /// Returns the sphere about a capture as Bevy apps compute it; `None` if nothing is drawn.
    pub fn of(scene: &RuntimeScene) -> Option<Self> {
        let [first, last] = scene.trained_with.time_interval;
        // A still never leaves its first moment.
        let shown = if scene.playback.duration_seconds > 0.0 { [first, last] } else { [first, first] };
        let bounds = Bounds::of(scene.iter(), shown)?;
        let (center, radius) = (bounds.center(), bounds.radius());
        (center.is_finite() && radius.is_finite() && radius > 0.0).then_some(Self { bounds, center, radius })
    }

    /// Returns the view from a direction (of length 1, away from the center) in which the sphere is `pixels` pixels across.
    fn view(&self, direction: Vec3, time: f32, pixels: f32) -> View {
        // No closer than the near limit allows.
        let distance = (DISTANCE * self.radius).max(self.radius + 1.0);
        let side = pixels.ceil() as u32 + 2 * MARGIN;
        let focal = pixels / pixels_across(self.radius, distance, 1.0);
        let fov = 2.0 * (side as f32 / (2.0 * focal)).atan();
        let up = if direction.z.abs() > 0.9 { Vec3::X } else { Vec3::Z };
        let eye = self.center + direction * distance;
        Camera::look_at(eye, self.center, up, fov, UVec2::splat(side)).view(time, RasterFov::Corrected)
    }
}

impl Around {
    /// Returns the directions and times.
    fn all(&self, [first, last]: [f32; 2]) -> impl Iterator<Item = (Vec3, f32)> {
        // Even over the sphere: a spiral that turns by the golden angle.
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

/// Draws all Gaussians from around at each of these sizes, pixels. Begins the task "looking".
pub(super) fn looks(
    headless: &mut Headless,
    capture: &GpuCapture,
    sphere: &Sphere,
    interval: [f32; 2],
    around: Around,
    sizes: &[f32],
    progress: &mut dyn Progress,
) -> Result<Vec<Vec<Look>>, OfflineError> {
    progress.begin("looking", sizes.len());
    let mut all = Vec::with_capacity(sizes.len());
    for &pixels in sizes {
        let mut own = Vec::new();
        for (direction, time) in around.all(interval) {
            let view = sphere.view(direction, time, pixels);
            let frame = headless.render(capture, &view, BLACK)?;
            own.push(Look { view, frame, rectangle: rectangle(&view, &sphere.bounds) });
        }
        all.push(own);
        progress.advance();
    }
    progress.finish();
    Ok(all)
}

/// Returns the lowest PSNR of a capture in these views against all Gaussians, dB: inside the rectangle of the capture, over black or over
/// white, whichever is lower.
pub(super) fn worst_psnr(headless: &mut Headless, capture: &GpuCapture, looks: &[Look]) -> Result<f64, OfflineError> {
    let mut worst = f64::INFINITY;
    for look in looks {
        let frame = headless.render(capture, &look.view, BLACK)?;
        for behind in [0.0, 1.0] {
            worst = worst.min(psnr_over(&look.frame, &frame, look.rectangle, behind));
        }
    }
    Ok(worst)
}

/// Returns the PSNR of two frames over a grey background inside a rectangle, values clamped to 0..1.
fn psnr_over(a: &Frame, b: &Frame, [low, high]: [UVec2; 2], behind: f32) -> f64 {
    let width = a.picture.size.x;
    let over = |frame: &Frame, at: usize| {
        (frame.picture.pixels[at] + frame.transmittance[at] * behind).clamp(Vec3::ZERO, Vec3::ONE)
    };
    let (mut squares, mut count) = (0.0, 0u32);
    for y in low.y..high.y {
        for x in low.x..high.x {
            let at = (y * width + x) as usize;
            squares += f64::from((over(a, at) - over(b, at)).length_squared());
            count += 3;
        }
    }
    -10.0 * (squares / f64::from(count.max(1))).log10()
}

/// Returns the rectangle of a box in a view: its corner, and the corner beyond it, at least one pixel apart.
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

    fn sphere() -> Sphere {
        let bounds = Bounds { min: Vec3::new(-1.0, -0.5, 0.0), max: Vec3::new(1.0, 0.5, 2.0) };
        Sphere { bounds, center: bounds.center(), radius: bounds.radius() }
    }

    #[test]
    fn the_sphere_is_as_large_as_asked_for() {
        let sphere = sphere();
        for pixels in [4.0, 50.0, 300.0] {
            let view = sphere.view(Vec3::new(0.6, 0.0, 0.8), 0.0, pixels);
            let distance = view.camera_position.distance(sphere.center);
            let focal = view.focal().x;
            assert!((pixels_across(sphere.radius, distance, focal) - pixels).abs() < 1e-3 * pixels, "{pixels} pixels");
        }
    }

    #[test]
    fn the_rectangle_holds_the_box_and_little_else() {
        let view = sphere().view(Vec3::Y, 0.0, 100.0);
        let [low, high] = rectangle(&view, &sphere().bounds);
        let size = (high - low).as_vec2();
        // 2 x 2 units, of which the sphere of radius 1.5 is three across.
        assert!((60.0..80.0).contains(&size.x) && (60.0..80.0).contains(&size.y), "{low} to {high}");
        assert!(low.cmpge(UVec2::ONE).all() && high.cmplt(view.size).all(), "inside the picture");
    }

    #[test]
    fn directions_are_all_around_and_shifted_ones_are_others() {
        let around = Around { directions: 40, times: 3, shift: 0.0 };
        let all: Vec<(Vec3, f32)> = around.all([2.0, 4.0]).collect();
        assert_eq!(all.len(), 120, "each direction at each time");
        let middle = all.iter().map(|(direction, _)| *direction).sum::<Vec3>() / 120.0;
        assert!(middle.length() < 0.1, "no side is preferred: {middle}");
        assert!(all.iter().all(|(_, time)| (2.0..4.0).contains(time)), "within the interval");
        let other = Around { shift: 0.5, ..around };
        assert!(other.all([2.0, 4.0]).zip(&all).all(|(a, b)| a.0 != b.0 && a.1 != b.1), "none is the same");
    }
}
