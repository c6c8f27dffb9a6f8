//! Gaussians in cubic motion, as SpacetimeGaussians trains them.
//!
//! In: [`Cubic`] Gaussians, each with a polynomial for its mean and a line for its quaternion. Out: [`Imported`], with a straight piece for
//! each part of a path.

use super::columns::{Columns, Played, coefficient};
use super::error::ImportError;
use super::imported::Imported;
use super::in_pieces::{in_pieces, middle_scale, splitting, statements};
use crate::codec::options::ReadOptions;
use crate::gaussian::SMALLEST_CUTOFF;
use crate::scene::pieces::{Bends, Curve, Piece};
use crate::scene::{MAX_SEGMENTS, UpAxis};
use glam::{DQuat, DVec3, DVec4};

/// Frames of the clips that SpacetimeGaussians trains unless it is told another number.
const FRAMES: f32 = 50.0;
/// Frames a second of the datasets of these clips.
const FPS: f32 = 30.0;
/// Scales below this one are this one: the logarithm of 0 is not finite.
const SMALLEST_SCALE: f32 = 1e-8;

/// A Gaussian in cubic motion; `d` is the time since `mean_t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cubic {
    /// Mean at `mean_t`, capture space.
    pub mean: [f32; 3],
    /// Factors of d, d² and d³.
    pub motion: [[f32; 3]; 3],
    /// Quaternion w, x, y, z at `mean_t`, of any length.
    pub rotation: [f32; 4],
    /// Factor of d of the quaternion.
    pub turn: [f32; 4],
    /// Standard deviations, capture units.
    pub scale: [f32; 3],
    /// Logit of the opacity.
    pub opacity_logit: f32,
    /// Red, green and blue, 0 to 1.
    pub color: [f32; 3],
    /// Time of the largest opacity.
    pub mean_t: f32,
    /// The opacity is that at `mean_t` times exp(−(d/width)²); always the same if it is not finite.
    pub width: f32,
}

impl Cubic {
    fn position(&self, time: f64) -> DVec3 {
        let since = time - f64::from(self.mean_t);
        let [first, second, third] = self.motion.map(|factor| DVec3::from(factor.map(f64::from)));
        DVec3::from(self.mean.map(f64::from)) + ((third * since + second) * since + first) * since
    }

    /// Returns the quaternion at a time, x, y, z, w; that at `mean_t` if there it has no length.
    fn rotation(&self, time: f32) -> DQuat {
        let since = f64::from(time) - f64::from(self.mean_t);
        let [at_rest, turn] = [self.rotation, self.turn].map(|q| DVec4::from(q.map(f64::from)));
        let turned = (at_rest + turn * since).try_normalize().unwrap_or_else(|| at_rest.normalize_or(DVec4::X));
        DQuat::from_xyzw(turned.y, turned.z, turned.w, turned.x)
    }

    /// Returns the temporal standard deviation.
    fn sigma_t(&self) -> f32 {
        if self.width.is_finite() { self.width * std::f32::consts::FRAC_1_SQRT_2 } else { f32::INFINITY }
    }

    /// Returns whether all its values can be drawn.
    fn is_drawable(&self) -> bool {
        let Self { mean, motion, rotation, turn, scale, opacity_logit, color, mean_t, width } = self;
        let lists: [&[f32]; 7] =
            [mean, motion.as_flattened(), rotation, turn, scale, color, &[*opacity_logit, *mean_t]];
        // A width that is no number stands for one that was too large for its format.
        let is_present = !width.is_finite() || *width > 0.0;
        is_present && lists.iter().all(|list| list.iter().all(|value| value.is_finite())) && *rotation != [0.0; 4]
    }
}

/// Converts Gaussians in cubic motion, of a file whose times go from 0 to 1.
///
/// # Errors
/// Invalid options; no Gaussian that can be drawn.
pub(crate) fn imported(mut gaussians: Vec<Cubic>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let played = Played {
        up: UpAxis::NegY,
        time_interval: [0.0, 1.0],
        duration_seconds: FRAMES / options.fps.unwrap_or(FPS),
        marginal_cutoff: SMALLEST_CUTOFF,
    };
    let splitting = splitting(&played, options, MAX_SEGMENTS, Bends::Smoothly)?;
    let before = gaussians.len();
    gaussians.retain(Cubic::is_drawable);
    let dropped = before - gaussians.len();
    if gaussians.is_empty() {
        return Err(ImportError::damaged("it has no splat that can be drawn"));
    }
    let mut whole = Columns::with_capacity(gaussians.len(), 0);
    for gaussian in &gaussians {
        whole.mean.push(gaussian.mean);
        whole.log_scale.push(gaussian.scale.map(|scale| scale.max(SMALLEST_SCALE).ln()));
        whole.opacity_logit.push(gaussian.opacity_logit);
        whole.harmonics.values.extend(gaussian.color.map(coefficient));
    }
    let pieces = splitting.split(gaussians.len(), |index| {
        let gaussian = &gaussians[index];
        Curve {
            position: |time| gaussian.position(time),
            mean_t: gaussian.mean_t,
            sigma_t: gaussian.sigma_t(),
            scale: middle_scale(whole.log_scale[index]),
        }
    });
    let mut lost = statements(&pieces, gaussians.len(), splitting.tolerance);
    let turned = |piece: &Piece| {
        let gaussian = &gaussians[piece.source as usize];
        gaussian.rotation(piece.middle()).angle_between(gaussian.rotation(piece.times[0]))
    };
    let angle = pieces.pieces.iter().map(turned).fold(0.0, f64::max).to_degrees();
    if angle > 0.0 {
        lost.push(format!("The rotation of a piece is constant: that at its middle, at most {angle:.2} degrees from that at its beginning."));
    }
    if dropped > 0 {
        lost.push(format!("{dropped} splats with values that are not finite, or with no lifespan, are left out."));
    }
    if options.duration_seconds.is_none() {
        lost.push(format!(
            "The file does not have its duration: {:.2} seconds is assumed (50 frames); --duration sets another one.",
            played.duration_seconds
        ));
    }
    let sigmas: Vec<f32> = gaussians.iter().map(Cubic::sigma_t).collect();
    let columns = in_pieces(&whole, &sigmas, pieces, |piece| {
        let DQuat { x, y, z, w } = gaussians[piece.source as usize].rotation(piece.middle());
        [w, x, y, z].map(|value| value as f32)
    });
    Ok(Imported { scene: columns.into_scene(played, options)?, lost })
}
