//! The stages mask and compress of a bake.
//!
//! In: the remaining Gaussians. Out: their temporal filter; the bytes of the package.

use super::inputs::Inputs;
use super::tuning::with_codebooks;
use crate::codec::package;
use crate::offline::quantize::{self, CompressSettings};
use crate::offline::stages::Stages;
use crate::offline::store::Key;
use crate::offline::stored::Package;
use crate::offline::temporal_filter::filter as temporal_filter;
use crate::offline::{OfflineError, write_settings};
use crate::scene::{Form, GaussianScene, SceneForm, TemporalFilter};

/// The stage mask: computes the temporal filter of the remaining Gaussians. Returns the key of the scene with it, given that of the scene.
pub(super) fn mask(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scene: &GaussianScene,
    key: Key,
) -> Result<(TemporalFilter, Key), OfflineError> {
    let (kind, keys) = (inputs.settings.filter, inputs.key_frames());
    let options = key.with(inputs.cameras_key).and(&format!("{kind:?} {keys}"));
    let is_whole = |filter: &TemporalFilter| filter.count == scene.len();
    let (filter, masked) = stages.run("mask", options, is_whole, |progress| {
        temporal_filter(inputs.engine, scene, kind, keys, &inputs.views, progress)
    })?;
    Ok((filter, key.with(masked)))
}

/// The stage compress: returns the bytes of the package of a scene, with trained codebooks if the scene has been fine-tuned.
pub(super) fn compress(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scene: GaussianScene,
    is_tuned: bool,
    key: Key,
) -> Result<Vec<u8>, OfflineError> {
    let settings = inputs.settings;
    let key = if inputs.tunes().is_some() { key.with(inputs.images_key()) } else { key };
    let key = key.and(&format!("{:?} {:?} {:?}", settings.quality, settings.level, inputs.tunes()));
    let (Package(bytes), _) = stages.run(
        "compress",
        key,
        |_| true,
        |progress| {
            let scene = if is_tuned { with_codebooks(inputs, scene, key, progress)? } else { scene };
            let packed = match scene.form {
                // The scene with trained codebooks.
                SceneForm::Ready(Form::Packed(_)) => scene,
                SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => {
                    let runtime = scene.into_runtime();
                    let runtime = runtime.map_err(|error| OfflineError::at(&settings.checkpoint, error))?;
                    quantize::compress(runtime, &CompressSettings::from(settings.quality))?.0
                }
            };
            let mut bytes = Vec::new();
            package::write(&mut bytes, &packed, &write_settings(&packed.form, settings.level))?;
            Ok(Package(bytes))
        },
    )?;
    Ok(bytes)
}
