//! Gaussians on curved paths as columns of straight pieces.
//!
//! In: the columns of the Gaussians, the [`Pieces`] of their paths. Out: the [`Columns`] of the pieces, and sentences.

use super::columns::{Columns, Motion, Played};
use super::error::ImportError;
use crate::codec::options::ReadOptions;
use crate::gaussian::Harmonics;
use crate::scene::pieces::{Bends, MOST, MOST_OF_ONE, Piece, Pieces, Splitting};

/// The default tolerance of paths, in middle scales of their Gaussians.
const TOLERANCE: f32 = 0.25;

/// Returns how paths are split, according to the options.
///
/// # Errors
/// Invalid options.
pub(crate) fn splitting(
    played: &Played,
    options: &ReadOptions,
    segments: u32,
    bends: Bends,
) -> Result<Splitting, ImportError> {
    options.check()?;
    Ok(Splitting {
        interval: options.time_interval.unwrap_or(played.time_interval),
        segments,
        bends,
        tolerance: options.tolerance.unwrap_or(TOLERANCE),
        cutoff: options.marginal_cutoff.unwrap_or(played.marginal_cutoff),
    })
}

/// Returns the middle one of three scales.
pub(crate) fn middle_scale(log_scale: [f32; 3]) -> f32 {
    let [a, b, c] = log_scale;
    a.max(b).min(a.min(b).max(c)).exp()
}

/// Returns the columns of the pieces: scales, opacities, colors and lifespans are those of their Gaussians. `whole` are
/// the columns of the Gaussians, `sigma_t` their temporal deviations, `rotation` returns the rotation of a piece.
pub(crate) fn in_pieces(
    whole: &Columns,
    sigma_t: &[f32],
    pieces: Pieces,
    rotation: impl Fn(&Piece) -> [f32; 4],
) -> Columns {
    let own = |piece: &Piece| piece.source as usize;
    let all = &pieces.pieces;
    let row = whole.harmonics.coefficients * 3;
    let color = |piece: &Piece| whole.harmonics.values.iter().skip(own(piece) * row).take(row).copied();
    Columns {
        mean: all.iter().map(|piece| piece.mean).collect(),
        log_scale: all.iter().map(|piece| whole.log_scale[own(piece)]).collect(),
        rotation: all.iter().map(rotation).collect(),
        opacity_logit: all.iter().map(|piece| whole.opacity_logit[own(piece)]).collect(),
        motion: all
            .iter()
            .map(|piece| Motion { velocity: piece.velocity, mean_t: piece.mean_t, sigma_t: sigma_t[own(piece)] })
            .collect(),
        harmonics: Harmonics { values: all.iter().flat_map(color).collect(), ..whole.harmonics },
        filter: Some(pieces.filter),
        origin: whole.origin,
        mip_filter: whole.mip_filter,
    }
}

/// Returns sentences about the differences of pieces from their `paths` paths; `given` is the requested tolerance.
pub(crate) fn statements(pieces: &Pieces, paths: usize, given: f32) -> Vec<String> {
    let Pieces { pieces: all, error, relative_error, coarse, unseen, tolerance, .. } = pieces;
    let mut lost = vec![format!(
        "The curved paths of {paths} Gaussians are {} straight pieces, which are at most {relative_error:.3} of the Gaussian's middle scale \
         from the path, and at most {error:.3e} units.",
        all.len()
    )];
    if *tolerance > given {
        lost.push(format!(
            "The tolerance is {tolerance} middle scales in place of {given}, so that there are at most {MOST} pieces."
        ));
    }
    if *coarse > 0 {
        lost.push(format!(
            "{coarse} paths are farther from their pieces than {given} middle scales: a path has at most {MOST_OF_ONE} pieces, which begin \
             at segments of the temporal filter."
        ));
    }
    if *unseen > 0 {
        lost.push(format!("{unseen} Gaussians are never visible within the time interval and are left out."));
    }
    lost
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_scale_is_neither_the_smallest_nor_the_largest() {
        for scales in
            [[0.0, 1.0, 2.0], [1.0, 0.0, 2.0], [2.0, 0.0, 1.0], [2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 2.0, 1.0]]
        {
            assert_eq!(middle_scale(scales), 1.0_f32.exp(), "of {scales:?}");
        }
    }
}
