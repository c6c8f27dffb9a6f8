//! The stages mask and compress of a bake.
//!
//! In: the remaining Gaussians. Out: their temporal filter; the bytes of the package.

use super::BakeError;
use super::inputs::Inputs;
use super::tuning::with_codebooks;
use crate::codec::package;
use crate::offline::collide::collide;
use crate::offline::compress::{CompressSettings, compress as pack};
use crate::offline::filter::temporal_filter::filter;
use crate::offline::store::results::Key;
use crate::offline::store::stages::Stages;
use crate::offline::store::stored::Package;
use crate::offline::work::{FileError, write_settings};
use crate::scene::{Form, GaussianScene, SceneForm, TemporalFilter};
use std::sync::Arc;

/// The stage mask: computes the temporal filter of the remaining Gaussians. Returns the key of the scene with the
/// filter, given the key of the scene.
pub(super) fn mask(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scene: &GaussianScene,
    key: Key,
) -> Result<(TemporalFilter, Key), BakeError> {
    let (kind, keys) = (inputs.settings.filter, inputs.key_frames());
    let options = key.with(inputs.cameras_key).and(&format!("{kind:?} {keys}"));
    let is_whole = |filter: &TemporalFilter| filter.count == scene.len();
    let (filter, masked) = stages
        .run("mask", options, is_whole, |progress| filter(inputs.engine, scene, kind, keys, &inputs.views, progress))?;
    Ok((filter, key.with(masked)))
}

/// The stage compress: returns the bytes of the package of a scene, with trained codebooks if the scene has been
/// fine-tuned.
pub(super) fn compress(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scene: GaussianScene,
    is_tuned: bool,
    key: Key,
) -> Result<Vec<u8>, BakeError> {
    let settings = inputs.settings;
    let key = if inputs.tunes().is_some() { key.with(inputs.images_key()) } else { key };
    let key =
        key.and(&format!("{:?} {:?} {:?} {:?}", settings.quality, settings.level, inputs.tunes(), settings.order));
    // What is packed with the Gaussians does not change their codebooks.
    let of_codebooks = key;
    let key = settings.colliders.map_or(key, |colliders| key.and(&format!("{colliders:?}")));
    // A result of an earlier stage may have another sound.
    let sound = inputs.subject.scene.sound.clone();
    let key = sound.as_ref().map_or(key, |sound| key.with(Key::of(sound.bytes())));
    let scene = GaussianScene { sound, ..scene };
    let (Package(bytes), _) = stages.run(
        "compress",
        key,
        |_| true,
        |progress| -> Result<_, BakeError> {
            let scene = if is_tuned { with_codebooks(inputs, scene, of_codebooks, progress)? } else { scene };
            let mut packed = match scene.form {
                // The scene with trained codebooks.
                SceneForm::Ready(Form::Packed(_)) => scene,
                SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => {
                    let runtime = scene.into_runtime();
                    let runtime = runtime.map_err(|error| FileError::at(&settings.checkpoint, error))?;
                    let order = settings.order.clone();
                    pack(runtime, &CompressSettings { order, ..CompressSettings::from(settings.quality) })?.0
                }
            };
            if let Some(colliders) = &settings.colliders {
                packed.colliders = Some(Arc::new(collide(&packed, colliders, progress)?.colliders));
            }
            let mut bytes = Vec::new();
            package::write(&mut bytes, &packed, &write_settings(&packed.form, settings.level))?;
            Ok(Package(bytes))
        },
    )?;
    Ok(bytes)
}
