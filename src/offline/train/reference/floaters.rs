//! Floaters: Gaussians that hang before a camera, where only few cameras see them.
//!
//! In: raw parameters, the cameras of a rig, the place that they look at. Out: the indices of the floaters. A Gaussian
//! close before a camera can be given any color by the pictures of that camera alone, and spoils those of every camera
//! beside it. What really stands there is large in the pictures of more cameras.

use super::pinhole::Pinhole;
use crate::offline::engine::layout::TrainedRecord;
use crate::view::View;
use glam::Vec3;
use rayon::prelude::*;

/// The logit of opacity of a floater that has been found: below the least opacity that is drawn, so that it has no
/// gradient, and of a faded Gaussian, which is relocated or removed.
pub(crate) const HIDDEN: f32 = -8.0;
/// Largest distance before a camera, as a share of the distance of what the cameras look at.
const CLOSE: f32 = 0.15;
/// Least size in a picture in which a Gaussian counts as seen: two standard deviations, pixels.
pub(crate) const LARGE: f32 = 5.0;
/// Most cameras that see a floater.
const FEW: usize = 2;

/// Returns the indices of the floaters before cameras that look at `target`, ascending. Gaussians that are
/// [`HIDDEN`] already are left out.
pub(crate) fn floaters(records: &[TrainedRecord], cameras: &[View], target: Vec3) -> Vec<u32> {
    let lenses = cameras.iter().map(Pinhole::of);
    let cameras: Vec<(Pinhole, f32)> = lenses.map(|lens| (lens, CLOSE * lens.origin.distance(target))).collect();
    let is_found = |(_, record): &(usize, &TrainedRecord)| record.opacity_logit[0] > HIDDEN && hangs(record, &cameras);
    records.par_iter().enumerate().filter(is_found).map(|(index, _)| index as u32).collect()
}

/// Returns whether a Gaussian is close before one of these cameras, and is seen by few. Each camera has the largest
/// distance that is close.
fn hangs(record: &TrainedRecord, cameras: &[(Pinhole, f32)]) -> bool {
    let [x, y, z] = record.log_scale;
    let (position, scale) = (Vec3::from(record.mean), x.max(y).max(z).exp());
    let (mut is_close, mut seen) = (false, 0);
    for (lens, close) in cameras.iter().filter(|(lens, _)| lens.pixel_of(position).is_some()) {
        is_close |= lens.origin.distance(position) < *close;
        seen += usize::from(2.0 * scale > LARGE * lens.pixel_size(position));
        if seen > FEW {
            return false;
        }
    }
    is_close
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};
    use glam::UVec2;

    /// Returns six cameras on a circle, which look at the origin.
    fn rig() -> Vec<View> {
        let view = |index: usize| {
            let angle = index as f32 * std::f32::consts::TAU / 6.0;
            let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 0.0);
            Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 1.2, UVec2::new(320, 240)).view(0.0, RasterFov::Corrected)
        };
        (0..6).map(view).collect()
    }

    fn gaussian(mean: Vec3, scale: f32, logit: f32) -> TrainedRecord {
        let opacity_logit = [logit, 0.0, 0.0, 0.0];
        TrainedRecord { mean: mean.to_array(), log_scale: [scale.ln(); 3], opacity_logit, ..TrainedRecord::default() }
    }

    #[test]
    fn what_hangs_before_a_camera_is_a_floater_unless_others_see_it() {
        let cameras = rig();
        let close = Vec3::new(3.5, 0.02, 0.0);
        let records = [
            gaussian(close, 0.02, 0.0),
            // Hidden already.
            gaussian(close, 0.02, HIDDEN),
            // In the middle, far from all.
            gaussian(Vec3::ZERO, 0.02, 0.0),
            // Not as close as 15 % of four units.
            gaussian(Vec3::new(3.3, 0.0, 0.0), 0.02, 0.0),
            // So large that the cameras on the other side see it.
            gaussian(close, 0.2, 0.0),
            // Behind the camera.
            gaussian(Vec3::new(4.3, 0.0, 0.0), 0.02, 0.0),
            // Before another camera.
            gaussian(Vec3::new(-3.6, 0.0, 0.05), 0.01, 2.0),
            gaussian(Vec3::splat(f32::NAN), 0.02, 0.0),
        ];
        assert_eq!(floaters(&records, &cameras, Vec3::ZERO), [0, 6], "the two that hang before one camera");
        assert_eq!(floaters(&records, &[], Vec3::ZERO), [0; 0], "no cameras");
    }
}
