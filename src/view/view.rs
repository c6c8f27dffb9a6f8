//! Views: one camera at one time, with the numbers that the passes read.
//!
//! In: the matrix from capture space to camera space and a projection. Out: a [`View`] in the original rasterizer's conventions
//! (camera space x right, y down, z forward; pixel centres at integers), and the grid of tiles that its picture is drawn in.

use glam::{DMat4, DVec4, Mat4, UVec2, Vec2, Vec3, Vec4};

/// Side of a tile in pixels.
pub const TILE_SIZE: u32 = 16;

/// The original's near limit in capture units: what is not farther away is not drawn.
const NEAR: f32 = 0.2;

/// One camera at one time: what the passes read. Also carries a model transform, when the capture is placed in a world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Picture size in pixels.
    pub size: UVec2,
    /// Timestamp, in the capture's unit.
    pub time: f32,
    /// Capture space (the capture's own world) to camera space (OpenCV axes); may scale and shear when a model transform is included.
    pub world_to_camera: Mat4,
    /// Rows x and y of the projection: `P00, P11, P02, P12` in `ndc = (P00 x + P02 z, P11 y + P12 z) / z`; of an orthographic
    /// camera `P00, P11, P03, P13` in `ndc = (P00 x + P03, P11 y + P13)`.
    pub projection: Vec4,
    /// Whether rays are parallel. Background maps are then not shown: there is no one point they are seen from.
    pub orthographic: bool,
    /// Camera centre in capture space; of an orthographic camera the unit direction in which it looks.
    pub camera_position: Vec3,
    /// Tangents of half the field of view that shapes footprints (negative for the sentinel).
    pub tan_fov: Vec2,
    /// Near limit in camera units: 0.2 capture units; the near plane of an orthographic camera.
    pub near: f32,
}

impl View {
    /// A view from its parts; `world_to_camera` may include a model transform (rotation, translation, any scale).
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
            // Depth grows by |row z| camera units for each capture unit along the viewing direction.
            near: NEAR * world_to_camera.row(2).truncate().length(),
        }
    }

    /// A view with parallel rays: `projection` is `P00, P11, P03, P13`, `near` the plane before which nothing is drawn, camera units.
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
        }
    }

    /// Unit vector in capture space along which a point is seen.
    pub fn direction_to(&self, point: Vec3) -> Vec3 {
        if self.orthographic { self.camera_position } else { (point - self.camera_position).normalize() }
    }

    /// Half-angle tangents beyond which the rays that shape footprints are clamped (times 1.3): [`tan_fov`](Self::tan_fov), or enough
    /// for the wider side of an off-centre lens. Off-centre cameras of the original have the sentinel, which stays as it is.
    pub fn reach(&self) -> Vec2 {
        if self.orthographic || self.tan_fov.min_element() <= 0.0 {
            return self.tan_fov;
        }
        self.tan_fov * (1.0 + Vec2::new(self.projection.z, self.projection.w).abs())
    }

    /// Footprint focal lengths in pixels (negative for the sentinel); pixels for each camera unit where rays are parallel.
    pub fn focal(&self) -> Vec2 {
        self.size.as_vec2() / (2.0 * self.tan_fov)
    }

    /// Rows x and y of projection times world-to-camera.
    pub fn clip_rows(&self) -> [Vec4; 2] {
        let m: DMat4 = self.world_to_camera.as_dmat4();
        let p = self.projection.as_dvec4();
        let shift = if self.orthographic { DVec4::W } else { m.row(2) };
        [(m.row(0) * p.x + shift * p.z).as_vec4(), (m.row(1) * p.y + shift * p.w).as_vec4()]
    }

    /// Capture-space direction of the ray through pixel `(x, y)`, unit length.
    pub fn ray(&self, x: u32, y: u32) -> Vec3 {
        if self.orthographic {
            return self.camera_position;
        }
        let ndc = (Vec2::new(x as f32, y as f32) + 0.5) / self.size.as_vec2() * 2.0 - 1.0;
        let p = self.projection;
        let camera = Vec3::new((ndc.x - p.z) / p.x, (ndc.y - p.w) / p.y, 1.0);
        self.world_to_camera.inverse().transform_vector3(camera).normalize()
    }

    /// Number of 16 × 16 tiles across and down.
    pub fn tiles(&self) -> UVec2 {
        tiles(self.size)
    }
}

/// Number of tiles across and down that cover a picture of this size, pixels.
pub fn tiles(size: UVec2) -> UVec2 {
    (size + (TILE_SIZE - 1)) / TILE_SIZE
}
