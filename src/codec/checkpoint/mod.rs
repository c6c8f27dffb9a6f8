//! Checkpoints (`.pth`) of the original 4DGS trainer, read without Python.
//!
//! In: a seekable file, [`ReadOptions`], and the text of `cfg_args`. Out: a [`GaussianScene`] in the trained form.
//!
//! ```text
//! Archive   the zip: its entries, none of which may be compressed or beyond the end of the file
//! Pickle    data.pkl through a restricted unpickler: scalars, and tensors with the location of their values
//! State     the content of each slot of the trainer's tuple
//! read      the tensors needed, one pass each, directly to their destination; optimizer state is never read
//! ```

mod archive;
mod cfg_args;
mod error;
pub(crate) mod options;
mod pickle;
mod state;
mod tensor;

pub use error::CheckpointError;

use super::options::ReadOptions;
use crate::gaussian::{Harmonics, Model};
use crate::scene::{GaussianScene, RotationConvention, SceneForm, Trained};
use archive::Archive;
use options::FromFile;
use pickle::Pickle;
use state::State;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// Extensions of checkpoints, without the dot.
pub(crate) const EXTENSIONS: &[&str] = &["pth"];

/// Reads a checkpoint. `cfg_args` is the text of the file of that name in the same folder; `None` if there is none.
///
/// Rotations of the unflipped convention are converted; [`TrainedWith`](crate::scene::TrainedWith) records the
/// convention of the file.
///
/// # Errors
/// Invalid options; a damaged or foreign file; values that are not finite, quaternions of length zero.
pub fn read<R: Read + Seek>(
    reader: R,
    options: &ReadOptions,
    cfg_args: Option<&str>,
) -> Result<GaussianScene, CheckpointError> {
    options.check()?;
    let mut archive = Archive::open(reader)?;
    let bytes = archive.pickle()?;
    let pickle = Pickle::parse(&bytes)?;
    let state = State::of(&pickle)?;
    let mut parameters = state.parameters(&mut archive)?;
    let harmonics = state.harmonics(&mut archive, options.force_sh_3d.unwrap_or_default())?;
    let environment = state.environment(&mut archive)?;

    let rotation_convention = options.rotation_convention.unwrap_or_else(|| convention(&state, &harmonics));
    if rotation_convention == RotationConvention::Unflipped {
        parameters.flip_rotations();
    }
    let file = FromFile {
        has_environment: environment.is_some(),
        rotation_convention,
        iteration: state.iteration,
        spatial_lr_scale: state.spatial_lr_scale,
    };
    let trained_with = options::trained_with(options, cfg_args, &file);
    let playback = options::playback(options, &trained_with);
    let form = SceneForm::Trained(Trained { parameters, harmonics });
    Ok(GaussianScene { form, environment, filter: None, trained_with, playback, levels: Vec::new() })
}

/// Reads a checkpoint, and `cfg_args` in the same folder.
///
/// # Errors
/// As [`read`].
pub(super) fn read_file(
    path: &Path,
    file: BufReader<File>,
    options: &ReadOptions,
) -> Result<GaussianScene, CheckpointError> {
    read(file, options, cfg_args::read_for(path).as_deref())
}

/// Returns the convention of a file for which none is given. Code whose backward pass never wrote the time blocks is
/// older than the flip, so a file with time degree 2 and time blocks of exact zeros is certainly unflipped.
fn convention(state: &State, harmonics: &Harmonics) -> RotationConvention {
    let stretch = harmonics.coefficients * 3;
    let never_written = state.model == Model::Rotated4d
        && state.count > 0
        && state.degree_t == 2
        && stretch > 48
        && harmonics.values.chunks_exact(stretch).all(|sh| sh[48..].iter().all(|&value| value == 0.0));
    if never_written { RotationConvention::Unflipped } else { RotationConvention::Flipped }
}
