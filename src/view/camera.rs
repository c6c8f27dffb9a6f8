//! Cameras: pose, lens and picture size, as a dataset describes them.
//!
//! In: a pose and a [`Lens`], in the conventions of OpenCV and COLMAP. Out: a [`Camera`], which returns its [`View`] at
//! a time.

use super::View;
use super::optics::{Optics, RasterFov};
use glam::{Mat4, UVec2, Vec2, Vec3, Vec4};

/// A camera of a capture: pose, lens and picture size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// World to camera, OpenCV axes (x right, y down, z forward).
    pub world_to_camera: Mat4,
    /// Picture size in pixels.
    pub size: UVec2,
    /// The lens.
    pub lens: Lens,
}

/// The description of a camera's lens. The original treats the two descriptions differently ([`RasterFov`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// A *FoV camera*: tangents of half the horizontal and vertical field of view, centered.
    Fov {
        /// `tan(FovX / 2)`, `tan(FovY / 2)`.
        tan: Vec2,
    },
    /// An *intrinsics camera*: focal lengths and principal point in pixels (pixel centers at half-integers, as in
    /// COLMAP).
    Intrinsics {
        /// `fl_x`, `fl_y` in pixels.
        focal: Vec2,
        /// `cx`, `cy` in pixels.
        center: Vec2,
    },
}

impl Camera {
    /// Returns the lens of a FoV camera with square pixels, from its horizontal field of view (radians) and picture
    /// size (pixels).
    pub fn fov_lens(fov_x: f64, size: UVec2) -> Lens {
        let tan_x = (fov_x / 2.0).tan();
        Lens::Fov { tan: Vec2::new(tan_x as f32, (tan_x * f64::from(size.y) / f64::from(size.x)) as f32) }
    }

    /// Creates a camera at `eye` that looks at `target` (capture space), with the horizontal field of view given
    /// (radians).
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, fov_x: f32, size: UVec2) -> Self {
        // OpenGL axes to OpenCV axes: y and z are negated.
        let flip = Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
        let world_to_camera = flip * Mat4::look_at_rh(eye, target, up);
        Self { world_to_camera, size, lens: Self::fov_lens(f64::from(fov_x), size) }
    }

    /// Returns the view of this camera at `time`, in the capture's unit. `optics` are those of the capture, or a
    /// [`RasterFov`] alone with the near plane of the original.
    pub fn view(&self, time: f32, optics: impl Into<Optics>) -> View {
        let optics = optics.into();
        let size = self.size.as_vec2();
        let (projection, tan_fov) = match self.lens {
            Lens::Fov { tan } => (Vec4::new(tan.x.recip(), tan.y.recip(), 0.0, 0.0), tan),
            Lens::Intrinsics { focal, center } => {
                let scale = 2.0 * focal / size;
                let offset = (2.0 * center - size) / size;
                let tan = match optics.raster_fov {
                    RasterFov::Reference => Vec2::splat((-0.5f64).tan() as f32),
                    RasterFov::Corrected => size / (2.0 * focal),
                };
                (Vec4::new(scale.x, scale.y, offset.x, offset.y), tan)
            }
        };
        View::new(self.size, time, self.world_to_camera, projection, tan_fov).with_optics(optics)
    }
}
