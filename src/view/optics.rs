//! The part of drawing that depends on the training of a capture and not on the camera.
//!
//! In: the settings that a capture was trained with. Out: [`Optics`], from which [`Camera::view`](super::Camera::view)
//! makes a view.

/// Near plane of the original, capture units: a Gaussian is not drawn unless its depth is larger.
pub const NEAR: f32 = 0.2;

/// The field of view that shapes the footprints of splats seen by an intrinsics camera. Default:
/// [`Reference`](Self::Reference).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RasterFov {
    /// The original's placeholder of −1 rad on both axes (the *sentinel*), with which its N3V-type captures were
    /// trained. FoV cameras are not affected.
    #[default]
    Reference,
    /// The camera's true field of view.
    Corrected,
}

/// How a capture is drawn by any camera. Default: as in the original.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Which field of view shapes the footprints of splats. Default: [`RasterFov::Reference`].
    pub raster_fov: RasterFov,
    /// Near plane, capture units: a Gaussian is not drawn unless its depth is larger. Default: [`NEAR`].
    pub near: f32,
    /// Size of a pixel of the training views where they see the capture, capture units; as
    /// [`View::trained_pixel`](super::View::trained_pixel). 0: the opacity of every splat is reduced, as by the filter
    /// of Mip-Splatting. Default: infinite, no reduction.
    pub trained_pixel: f32,
}

impl Default for Optics {
    fn default() -> Self {
        RasterFov::default().into()
    }
}

impl From<RasterFov> for Optics {
    /// Returns the optics with the near plane of the original, without reduction of opacity.
    fn from(raster_fov: RasterFov) -> Self {
        Self { raster_fov, near: NEAR, trained_pixel: f32::INFINITY }
    }
}
