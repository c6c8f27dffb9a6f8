//! Gaussians on cubic paths, as SpacetimeGaussians trains them.
//!
//! In: columns of Gaussians with velocities and lifespans, and how each path [bends](Bend). Out: [`Imported`], with a
//! straight piece for each part of a path.

use super::assumed;
use super::columns::{Columns, Played};
use super::drawable::keep_drawable_and;
use super::error::ImportError;
use super::imported::Imported;
use super::in_pieces::{in_pieces, middle_scale, splitting, statements};
use crate::codec::options::{FPS, ReadOptions};
use crate::gaussian::SMALLEST_CUTOFF;
use crate::scene::pieces::{ALWAYS, Bends, Curve, Piece};
use crate::scene::{MAX_SEGMENTS, UpAxis};
use glam::{DQuat, DVec3, DVec4};
use std::f32::consts::FRAC_1_SQRT_2;

/// Default number of frames of a clip of SpacetimeGaussians.
const FRAMES: f32 = 50.0;

/// How a path differs from a straight line, and how the Gaussian turns; `d` is the time since `mean_t`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Bend {
    /// Factor of d² of the mean, capture space.
    pub second: [f32; 3],
    /// Factor of d³ of the mean.
    pub third: [f32; 3],
    /// Factor of d of the quaternion w, x, y, z.
    pub turn: [f32; 4],
}

impl Bend {
    fn is_finite(&self) -> bool {
        let Self { second, third, turn } = self;
        second.iter().chain(third).chain(turn).all(|value| value.is_finite())
    }
}

/// Returns the temporal deviation of an envelope exp(−(d/width)²), infinite for a width too large for its format.
pub(crate) fn sigma_of_width(width: f32) -> f32 {
    if width.is_finite() { width * FRAC_1_SQRT_2 } else { f32::INFINITY }
}

/// Returns how a clip of SpacetimeGaussians is played. Its file does not have its duration: a sentence about the
/// assumed one is added to `lost`.
pub(crate) fn spacetime_clip(options: &ReadOptions, lost: &mut Vec<String>) -> Played {
    let duration_seconds = FRAMES / options.fps.unwrap_or(FPS);
    lost.extend(assumed::duration(duration_seconds, options));
    Played { up: UpAxis::NegY, time_interval: [0.0, 1.0], duration_seconds, marginal_cutoff: SMALLEST_CUTOFF }
}

/// Converts Gaussians on cubic paths. Means, rotations and velocities in `whole` are those at `mean_t`.
///
/// # Errors
/// Invalid options; no Gaussian that can be drawn.
pub(crate) fn imported(
    mut whole: Columns,
    mut bends: Vec<Bend>,
    played: Played,
    options: &ReadOptions,
    mut lost: Vec<String>,
) -> Result<Imported, ImportError> {
    if bends.len() != whole.len() || whole.motion.len() != whole.len() {
        return Err(ImportError::damaged("its attributes have different numbers of Gaussians"));
    }
    let splitting = splitting(&played, options, MAX_SEGMENTS, Bends::Smoothly)?;
    for (mean, bend) in whole.mean.iter_mut().zip(&bends) {
        if !bend.is_finite() {
            *mean = [f32::NAN; 3];
        }
    }
    lost.extend(keep_drawable_and(&mut whole, |kept| bends = kept.iter().map(|&index| bends[index]).collect()));
    if whole.len() == 0 {
        return Err(ImportError::damaged("it has no Gaussians that can be drawn"));
    }
    let position = |index: usize, time: f64| {
        let (own, bend) = (&whole.motion[index], &bends[index]);
        let since = time - f64::from(own.mean_t);
        let [at_rest, first, second, third] =
            [whole.mean[index], own.velocity, bend.second, bend.third].map(|factor| DVec3::from(factor.map(f64::from)));
        at_rest + ((third * since + second) * since + first) * since
    };
    let rotation = |index: usize, time: f32| {
        let since = f64::from(time) - f64::from(whole.motion[index].mean_t);
        let [at_rest, turn] = [whole.rotation[index], bends[index].turn].map(|q| DVec4::from(q.map(f64::from)));
        let turned = (at_rest + turn * since).try_normalize().unwrap_or_else(|| at_rest.normalize_or(DVec4::X));
        DQuat::from_xyzw(turned.y, turned.z, turned.w, turned.x)
    };
    let pieces = splitting.split(whole.len(), |index| {
        let (mean_t, sigma_t) = (whole.motion[index].mean_t, whole.motion[index].sigma_t);
        let scale = middle_scale(whole.log_scale[index]);
        Curve { position: move |time| position(index, time), mean_t, sigma_t, window: ALWAYS, scale }
    });
    lost.extend(statements(&pieces, whole.len(), splitting.tolerance));
    let turned = |piece: &Piece| {
        let [middle, first] = [piece.middle(), piece.times[0]].map(|time| rotation(piece.source as usize, time));
        middle.angle_between(first)
    };
    let angle = pieces.pieces.iter().map(turned).fold(0.0, f64::max).to_degrees();
    if bends.iter().any(|bend| bend.turn != [0.0; 4]) {
        lost.push(format!(
            "The rotation of a piece is constant: that at its middle, at most {angle:.1} degrees from that at its beginning."
        ));
    }
    let sigmas: Vec<f32> = whole.motion.iter().map(|motion| motion.sigma_t).collect();
    let columns = in_pieces(&whole, &sigmas, pieces, |piece| {
        let DQuat { x, y, z, w } = rotation(piece.source as usize, piece.middle());
        [w, x, y, z].map(|value| value as f32)
    });
    Ok(Imported { scene: columns.into_scene(played, options)?, lost })
}
