//! Views: one camera at one time, with the numbers that the passes read.
//!
//! In: the matrix from capture space to camera space and a projection. Out: a [`View`] in the original rasterizer's
//! conventions (camera space x right, y down, z forward; pixel centers at integers), and the grid of tiles of its
//! picture.

use super::optics::{NEAR, Optics};
use glam::{DMat4, DVec4, Mat4, UVec2, Vec2, Vec3, Vec4};

/// Side of a tile in pixels.
pub const TILE_SIZE: u32 = 16;

/// One camera at one time: the input of the passes. Includes the model transform of a capture that is placed in a
/// world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Picture size in pixels.
    pub size: UVec2,
    /// Timestamp, in the capture's unit.
    pub time: f32,
    /// Capture space (the capture's own world) to camera space (OpenCV axes); may scale and shear when a model
    /// transform is included.
    pub world_to_camera: Mat4,
    /// Rows x and y of the projection: `P00, P11, P02, P12` in `ndc = (P00 x + P02 z, P11 y + P12 z) / z`. For an
    /// orthographic camera: `P00, P11, P03, P13` in `ndc = (P00 x + P03, P11 y + P13)`.
    pub projection: Vec4,
    /// Whether the camera is orthographic, with parallel rays. Environment maps are then not shown: they need a camera
    /// position.
    pub orthographic: bool,
    /// Camera center in capture space; for an orthographic camera, the unit vector of its viewing direction.
    pub camera_position: Vec3,
    /// Tangents of half the field of view that shapes footprints (negative for the sentinel).
    pub tan_fov: Vec2,
    /// Near plane in camera units: that of the capture ([`Optics::near`]), scaled as the capture is; for an
    /// orthographic camera, its own.
    pub near: f32,
    /// Size of a pixel of the training views where they see the capture, capture units. The opacity of splats that
    /// larger pixels blur is reduced accordingly. Infinite: no reduction, as in the original. 0: the reduction of
    /// Mip-Splatting.
    pub trained_pixel: f32,
}

impl View {
    /// Creates a view from its parts, with the near plane of the original; `world_to_camera` may include a model
    /// transform (rotation, translation, any scale).
    pub fn new(size: UVec2, time: f32, world_to_camera: Mat4, projection: Vec4, tan_fov: Vec2) -> Self {
        let inverse = world_to_camera.as_dmat4().inverse();
        Self {
            size,
            time,
            world_to_camera,
            projection,
            orthographic: false,
            camera_position: inverse.w_axis.truncate().as_vec3(),
            tan_fov,
            near: near_in_camera(NEAR, &world_to_camera),
            trained_pixel: f32::INFINITY,
        }
    }

    /// Creates a view with parallel rays: `projection` is `P00, P11, P03, P13`, `near` the near plane in camera units.
    pub fn orthographic(size: UVec2, time: f32, world_to_camera: Mat4, projection: Vec4, near: f32) -> Self {
        let inverse = world_to_camera.as_dmat4().inverse();
        Self {
            size,
            time,
            world_to_camera,
            projection,
            orthographic: true,
            camera_position: inverse.z_axis.truncate().normalize().as_vec3(),
            tan_fov: Vec2::new(projection.x, projection.y).recip(),
            near,
            trained_pixel: f32::INFINITY,
        }
    }

    /// Returns the view with the near plane and the training pixel of a capture. An orthographic view keeps its own
    /// near plane.
    pub fn with_optics(self, optics: Optics) -> Self {
        let near = if self.orthographic { self.near } else { near_in_camera(optics.near, &self.world_to_camera) };
        Self { near, trained_pixel: optics.trained_pixel, ..self }
    }

    /// Returns the view with anti-aliasing, given the size of a pixel of the training views (`None`, not known: without
    /// further anti-aliasing). The smaller of both sizes is used, so that the mip filter of a capture remains.
    pub fn antialiased(self, trained_pixel: Option<f32>) -> Self {
        Self { trained_pixel: trained_pixel.map_or(self.trained_pixel, |pixel| self.trained_pixel.min(pixel)), ..self }
    }

    /// Returns the variances across and down the screen of a variance of one training pixel squared, at a scale of one
    /// pixel per camera unit; at most 1e20, which stands for infinity.
    pub fn trained_variance(&self) -> Vec2 {
        let along = |row| {
            let pixel = self.trained_pixel * self.world_to_camera.row(row).truncate().length();
            (pixel * pixel).min(1e20)
        };
        Vec2::new(along(0), along(1))
    }

    /// Returns the viewing direction of a point, a unit vector in capture space.
    pub fn direction_to(&self, point: Vec3) -> Vec3 {
        if self.orthographic { self.camera_position } else { (point - self.camera_position).normalize() }
    }

    /// Returns the half-angle tangents to which the rays that shape footprints are clamped (times 1.3):
    /// [`tan_fov`](Self::tan_fov), enlarged for the wider side of an off-center lens. The sentinel is returned
    /// unchanged; off-center cameras of the original have it.
    pub fn reach(&self) -> Vec2 {
        if self.orthographic || self.tan_fov.min_element() <= 0.0 {
            return self.tan_fov;
        }
        self.tan_fov * (1.0 + Vec2::new(self.projection.z, self.projection.w).abs())
    }

    /// Returns the focal lengths that shape footprints, in pixels (negative for the sentinel); for an orthographic
    /// camera, pixels per camera unit.
    pub fn focal(&self) -> Vec2 {
        self.size.as_vec2() / (2.0 * self.tan_fov)
    }

    /// Returns rows x and y of projection times world-to-camera.
    pub fn clip_rows(&self) -> [Vec4; 2] {
        let m: DMat4 = self.world_to_camera.as_dmat4();
        let p = self.projection.as_dvec4();
        let shift = if self.orthographic { DVec4::W } else { m.row(2) };
        [(m.row(0) * p.x + shift * p.z).as_vec4(), (m.row(1) * p.y + shift * p.w).as_vec4()]
    }

    /// Returns the unit direction, in capture space, of the ray through pixel `(x, y)`.
    pub fn ray(&self, x: u32, y: u32) -> Vec3 {
        if self.orthographic {
            return self.camera_position;
        }
        let ndc = (Vec2::new(x as f32, y as f32) + 0.5) / self.size.as_vec2() * 2.0 - 1.0;
        let p = self.projection;
        let camera = Vec3::new((ndc.x - p.z) / p.x, (ndc.y - p.w) / p.y, 1.0);
        self.world_to_camera.inverse().transform_vector3(camera).normalize()
    }

    /// Returns whether every number that the passes read is finite.
    pub fn is_finite(&self) -> bool {
        let [x, y] = self.clip_rows();
        let finite = [self.projection, x, y].iter().all(|numbers| numbers.is_finite());
        let shape = [self.tan_fov, self.reach(), self.focal()].iter().all(|pair| pair.is_finite());
        finite && shape && self.world_to_camera.is_finite() && self.camera_position.is_finite() && self.near.is_finite()
    }

    /// Returns the number of 16 × 16 tiles across and down.
    pub fn tiles(&self) -> UVec2 {
        tiles(self.size)
    }
}

/// Converts a near plane from capture units to camera units.
fn near_in_camera(near: f32, world_to_camera: &Mat4) -> f32 {
    // Depth grows by |row z| camera units for each capture unit along the viewing direction.
    near * world_to_camera.row(2).truncate().length()
}

/// Returns the number of tiles across and down that cover a picture of this size (pixels).
pub fn tiles(size: UVec2) -> UVec2 {
    (size + (TILE_SIZE - 1)) / TILE_SIZE
}
