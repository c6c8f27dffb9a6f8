//! Faults of cameras: the reasons why a camera cannot draw captures as it draws meshes.
//!
//! In: a camera's projection matrix and compositing space. Out: a [`CameraFault`].

use crate::plugin::render::captures::view::CameraLens;
use bevy::camera::CompositingSpace;
use glam::Mat4;

/// The reason why a camera cannot draw captures as it draws meshes. The text names the remedy. It is logged once and
/// shown by the inspector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraFault {
    /// Colors are composited in Oklab.
    #[error("captures are not drawn for a camera with CompositingSpace::Oklab: use Srgb or Linear")]
    Oklab,
    /// The projection is not a supported perspective or orthographic projection.
    #[error(
        "captures are not drawn for a camera whose projection is skewed, mirrored or not reversed in depth: use Bevy's \
         perspective or orthographic projection, or Projection::custom with a matrix like theirs"
    )]
    Projection,
    /// The depth of meshes also depends on the position in the picture.
    #[error(
        "captures are drawn over meshes, not behind them, and write no depth, for a camera with its own near clip \
         plane: leave PerspectiveProjection::near_clip_plane at its default, or draw captures with another camera"
    )]
    NearPlane,
}

impl CameraFault {
    /// Returns the most severe fault of a camera with this projection matrix (`Camera::clip_from_view`) and this
    /// compositing space, if the component is present; `None` if captures are drawn correctly.
    pub fn of(clip_from_view: &Mat4, space: Option<CompositingSpace>) -> Option<Self> {
        if space == Some(CompositingSpace::Oklab) {
            return Some(Self::Oklab);
        }
        match CameraLens::of(clip_from_view) {
            None => Some(Self::Projection),
            Some(lens) if lens.distance.is_none() => Some(Self::NearPlane),
            Some(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::camera::{CameraProjection, OrthographicProjection, PerspectiveProjection};
    use glam::Vec3;

    #[test]
    fn projections_of_bevy_have_no_fault_except_in_oklab() {
        let lenses = [
            PerspectiveProjection::default().get_clip_from_view(),
            OrthographicProjection::default_3d().get_clip_from_view(),
        ];
        for lens in lenses {
            for space in [None, Some(CompositingSpace::Srgb), Some(CompositingSpace::Linear)] {
                assert_eq!(CameraFault::of(&lens, space), None, "no fault in {space:?}");
            }
            let oklab = CameraFault::of(&lens, Some(CompositingSpace::Oklab));
            assert_eq!(oklab, Some(CameraFault::Oklab), "captures are not drawn in Oklab");
        }
    }

    #[test]
    fn unsupported_projections_are_faults() {
        let mut skewed = OrthographicProjection::default_3d().get_clip_from_view();
        skewed.z_axis.x = 0.1;
        assert_eq!(
            CameraFault::of(&skewed, None),
            Some(CameraFault::Projection),
            "a skewed projection is not supported"
        );
        let plane = Vec3::new(0.1, 0.0, -1.0).normalize().extend(-0.4);
        let oblique = PerspectiveProjection { near_clip_plane: plane, ..PerspectiveProjection::default() };
        let fault = CameraFault::of(&oblique.get_clip_from_view(), None);
        assert_eq!(fault, Some(CameraFault::NearPlane), "an oblique near plane is reported");
    }
}
