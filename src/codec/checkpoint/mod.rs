//! Checkpoints of the original 4DGS trainer (`.pth`), gsplat (`.pt`) and nerfstudio (`.ckpt`), read without Python.
//!
//! In: a seekable file, [`ReadOptions`], and the text of `cfg_args`. Out: a [`GaussianScene`] in the trained form.
//!
//! ```text
//! Archive   the zip: its entries, none of which may be compressed or beyond the end of the file
//! Legacy    the same for files of torch before 1.6, which are no zip
//! Pickle    data.pkl through a restricted unpickler: scalars, and tensors with the location of their values
//! State     the content of each slot of the trainer's tuple
//! Splats    the tensors of another trainer, by their names in a dictionary
//! read      the tensors needed, one pass each, directly to their destination; optimizer state is never read
//! ```

mod archive;
mod cfg_args;
mod error;
mod legacy;
pub(crate) mod options;
mod pickle;
mod splats;
mod state;
mod tensor;

pub use error::CheckpointError;

use super::import::Imported;
use super::import::source::Beside;
use super::options::ReadOptions;
use super::text::printable;
use crate::gaussian::{Harmonics, Model};
use crate::scene::{GaussianScene, RotationConvention, SceneForm, Trained};
use archive::Archive;
use options::FromFile;
use pickle::{Pickle, Value};
use splats::Splats;
use state::State;
use std::io::{Read, Seek};
use std::path::Path;

/// Extensions of checkpoints, without the dot.
pub(crate) const EXTENSIONS: &[&str] = &["pth", "pt", "ckpt"];

/// Returns whether a file that starts so is one of torch before 1.6.
pub(super) fn is_legacy(start: &[u8]) -> bool {
    start.starts_with(legacy::START)
}

/// Reads a checkpoint. `cfg_args` is the text of the file of that name in the same folder; `None` if there is none.
///
/// Unflipped rotations are converted; [`TrainedWith`](crate::scene::TrainedWith) records the convention of the file.
///
/// # Errors
/// Invalid options; a damaged or foreign file; values that are not finite, quaternions of length zero.
pub fn read<R: Read + Seek>(
    reader: R,
    options: &ReadOptions,
    cfg_args: Option<&str>,
) -> Result<GaussianScene, CheckpointError> {
    Ok(read_stating(reader, options, cfg_args)?.scene)
}

/// As [`read`], with what of the file the scene does not show.
///
/// # Errors
/// As [`read`].
fn read_stating<R: Read + Seek>(
    reader: R,
    options: &ReadOptions,
    cfg_args: Option<&str>,
) -> Result<Imported, CheckpointError> {
    options.check()?;
    let mut archive = Archive::open(reader)?;
    let bytes = archive.pickle()?;
    let pickle = parse(&bytes)?;
    match Splats::of(&pickle) {
        Some(splats) => splats.imported(&mut archive, options),
        None => Ok(Imported { scene: native(&pickle, &mut archive, options, cfg_args)?, lost: Vec::new() }),
    }
}

/// Parses the pickle of a checkpoint. Objects that the 4DGS trainer does not write are accepted only if the outermost
/// value is a dictionary, as other trainers write it.
fn parse(bytes: &[u8]) -> Result<Pickle<'_>, CheckpointError> {
    Pickle::parse(bytes).or_else(|refused| match Pickle::parse_inert(bytes) {
        Ok(pickle) if matches!(pickle.root(), Value::Dict(_)) => Ok(pickle),
        _ => Err(refused),
    })
}

/// Reads a checkpoint of the 4DGS trainer.
fn native<R: Read + Seek>(
    pickle: &Pickle<'_>,
    archive: &mut Archive<R>,
    options: &ReadOptions,
    cfg_args: Option<&str>,
) -> Result<GaussianScene, CheckpointError> {
    let state = State::of(pickle)?;
    let mut parameters = state.parameters(archive)?;
    let harmonics = state.harmonics(archive, options.force_sh_3d.unwrap_or_default())?;
    let environment = state.environment(archive)?;

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
    let (filter, levels, sockets, colliders, sound, chunks) = Default::default();
    Ok(GaussianScene { form, environment, filter, trained_with, playback, levels, sockets, colliders, sound, chunks })
}

/// Reads the checkpoint with this path, and `cfg_args` in the same folder.
///
/// # Errors
/// As [`read`].
pub(super) fn read_file(
    file: impl Read + Seek,
    path: &Path,
    beside: &dyn Beside,
    options: &ReadOptions,
) -> Result<Imported, CheckpointError> {
    let cfg_args = cfg_args::read(beside).map_err(CheckpointError::Io)?;
    let mut imported = read_stating(file, options, cfg_args.as_deref())?;
    let part = path.file_name().and_then(|name| splats::other_part(&name.to_string_lossy()));
    if let Some(part) = part.filter(|part| beside.has(part)) {
        imported.lost.push(format!(
            "Its training had several processes, each of which saved a part of the Gaussians: {} has others, which are not shown.",
            printable(&part)
        ));
    }
    Ok(imported)
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
