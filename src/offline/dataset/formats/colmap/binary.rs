//! Binary models: `cameras.bin` and `images.bin`.
//!
//! In: the folder of a model. Out: its cameras and images.

use super::camera::{MODELS, ModelCamera, unknown};
use super::model::{Model, Registered};
use super::text::twice;
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::formats::stream::Stream;
use std::collections::HashMap;
use std::path::Path;

/// Most bytes of the name of an image.
const LONGEST_NAME: usize = 4096;
/// Bytes of an image's point: its place and its number.
const POINT: u64 = 24;

pub(crate) fn read(folder: &Path) -> Result<Model, DatasetError> {
    let mut stream = Stream::open(&folder.join("cameras.bin"))?;
    let mut cameras = HashMap::new();
    for _ in 0..stream.u64()? {
        let (id, model) = (stream.u32()?, stream.u32()? as usize);
        let size = [stream.u64()?, stream.u64()?];
        let Some(&(_, count, _)) = MODELS.get(model) else { return Err(stream.unusable(unknown(&model.to_string()))) };
        let mut parameters = Vec::new();
        for _ in 0..count {
            parameters.extend(stream.f64s::<1>()?);
        }
        let camera = ModelCamera::new(model, size, &parameters);
        let camera = camera.map_err(|reason| stream.unusable(format!("camera {id}: {reason}")))?;
        if cameras.insert(id, camera).is_some() {
            return Err(stream.unusable(twice(id)));
        }
    }
    let source = folder.join("images.bin");
    let mut stream = Stream::open(&source)?;
    let mut images = Vec::new();
    for _ in 0..stream.u64()? {
        let _id = stream.u32()?;
        let (rotation, translation) = (stream.f64s()?, stream.f64s()?);
        let camera = stream.u32()?;
        let name = stream.text(LONGEST_NAME)?;
        let points = stream.u64()?;
        stream.skip(points, POINT)?;
        images.push(Registered { name, camera, pose: (rotation, translation) });
    }
    Ok(Model { source, cameras, images })
}
