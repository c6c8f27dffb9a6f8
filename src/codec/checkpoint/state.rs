//! The state tuple: the content of each slot.
//!
//! In: a [`Pickle`]. Out: a [`State`] whose numbers are checked and whose tensors are lazy; its methods read them from
//! the archive into [`Parameters`], [`Harmonics`] and [`Environment`].

use super::archive::{Archive, Rows, Slot};
use super::error::CheckpointError;
use super::pickle::{Id, Pickle, Value};
use crate::codec::text::printable;
use crate::gaussian::{Harmonics, Model, Parameters};
use crate::scene::Environment;
use std::io::{Read, Seek};

/// Largest number of coefficients per channel in the trainer: 16 spatial ones for each of three time blocks.
const COEFFICIENTS: u64 = 48;
/// Most keys of a dictionary in an error.
const KEYS: usize = 8;
/// Largest number of texels along an edge of an environment map.
const ENVIRONMENT_EDGE: u64 = 16_384;

/// The state of a checkpoint: scalars as values, tensors not yet read.
pub(super) struct State<'p> {
    /// The model of the original code.
    pub model: Model,
    /// Number of Gaussians.
    pub count: usize,
    /// Active spatial degree, 0 to 3.
    pub degree: u32,
    /// Active time degree, 0 to 2; used only if `degree` is 3.
    pub degree_t: u32,
    /// Iteration at which the checkpoint was written.
    pub iteration: u64,
    /// Factor of positional learning rates.
    pub spatial_lr_scale: f64,
    mean: Slot<'p>,
    features_dc: Slot<'p>,
    features_rest: Slot<'p>,
    log_scale: Slot<'p>,
    rotation_l: Slot<'p>,
    opacity: Slot<'p>,
    /// Temporal mean and scale of 4D models.
    temporal: Option<[Slot<'p>; 2]>,
    rotation_r: Option<Slot<'p>>,
    environment: Option<Slot<'p>>,
}

/// The entries of the state tuple.
struct Slots<'p> {
    pickle: &'p Pickle<'p>,
    ids: &'p [Id],
}

impl<'p> Slots<'p> {
    fn value(&self, index: usize) -> &'p Value<'p> {
        self.ids.get(index).map_or(&Value::None, |&id| self.pickle.get(id))
    }

    fn error(&self, index: usize, name: &'static str, expected: &'static str) -> CheckpointError {
        CheckpointError::Slot { index: Some(index), name, found: self.value(index).kind(), expected }
    }

    fn tensor(&self, index: usize, name: &'static str) -> Result<Slot<'p>, CheckpointError> {
        match self.value(index) {
            Value::Tensor(tensor) => Ok(Slot { index: Some(index), name, row: "Gaussian", tensor }),
            _ => Err(self.error(index, name, "a tensor")),
        }
    }

    fn degree(
        &self,
        index: usize,
        name: &'static str,
        most: u32,
        expected: &'static str,
    ) -> Result<u32, CheckpointError> {
        match *self.value(index) {
            Value::Int(value) => u32::try_from(value).ok().filter(|&degree| degree <= most).ok_or_else(|| {
                CheckpointError::Layout(format!("slot {index} ({name}) is {value}, expected {expected}"))
            }),
            _ => Err(self.error(index, name, expected)),
        }
    }

    /// Returns a finite number that is not negative.
    fn extent(&self, index: usize, name: &'static str) -> Result<f64, CheckpointError> {
        let value = match *self.value(index) {
            Value::Float(value) if value.is_finite() => value,
            Value::Int(value) => value as f64,
            _ => return Err(self.error(index, name, "a finite number")),
        };
        if value < 0.0 {
            let reason = format!("slot {index} ({name}) is {value}, expected a number that is not negative");
            return Err(CheckpointError::Layout(reason));
        }
        Ok(value)
    }

    fn flag(&self, index: usize, name: &'static str) -> Result<bool, CheckpointError> {
        match *self.value(index) {
            Value::Bool(value) => Ok(value),
            _ => Err(self.error(index, name, "a bool")),
        }
    }

    /// Returns the tensor of slot 17, of shape 3 × R × R; `None` if the slot, or the tensor of a map never set, is
    /// empty.
    fn environment(&self) -> Result<Option<Slot<'p>>, CheckpointError> {
        if matches!(self.value(17), Value::None) {
            return Ok(None);
        }
        let slot = Slot { row: "channel", ..self.tensor(17, "env_map")? };
        match slot.tensor.size[..] {
            [0] => Ok(None),
            [3, height, width] if height == width && (1..=ENVIRONMENT_EDGE).contains(&width) => Ok(Some(slot)),
            _ => Err(slot.shape_error(format!("[3, R, R] with R from 1 to {ENVIRONMENT_EDGE}"))),
        }
    }
}

impl<'p> State<'p> {
    /// Finds every value in its slot.
    ///
    /// # Errors
    /// Another layout than that of the 4DGS trainer, a slot of the wrong type, a number out of range.
    pub(super) fn of(pickle: &'p Pickle<'p>) -> Result<Self, CheckpointError> {
        let (slots, iteration) = pair(pickle)?;
        let moving = slots.ids.len() >= 19;
        let mean = slots.tensor(1, "_xyz")?;
        let count = match mean.tensor.size[..] {
            [count, 3] => usize::try_from(count).map_err(|_| mean.shape_error("[N, 3]"))?,
            _ => return Err(mean.shape_error("[N, 3]")),
        };
        let rotates = moving && slots.flag(16, "rot_4d")?;
        Ok(Self {
            model: match (moving, rotates) {
                (false, _) => Model::Static3d,
                (true, false) => Model::Unrotated4d,
                (true, true) => Model::Rotated4d,
            },
            count,
            degree: slots.degree(0, "active_sh_degree", 3, "an int from 0 to 3")?,
            degree_t: if moving { slots.degree(18, "active_sh_degree_t", 2, "an int from 0 to 2")? } else { 0 },
            iteration,
            spatial_lr_scale: slots.extent(if moving { 12 } else { 11 }, "spatial_lr_scale")?,
            mean,
            features_dc: slots.tensor(2, "_features_dc")?,
            features_rest: slots.tensor(3, "_features_rest")?,
            log_scale: slots.tensor(4, "_scaling")?,
            rotation_l: slots.tensor(5, "_rotation")?,
            opacity: slots.tensor(6, "_opacity")?,
            temporal: if moving { Some([slots.tensor(13, "_t")?, slots.tensor(14, "_scaling_t")?]) } else { None },
            rotation_r: if rotates { Some(slots.tensor(15, "_rotation_r")?) } else { None },
            environment: if moving { slots.environment()? } else { None },
        })
    }

    /// Reads the raw parameters, in the rotation convention of the file.
    ///
    /// # Errors
    /// A tensor of another shape or that cannot be read, a value that is not finite, a quaternion of length zero.
    pub(super) fn parameters<R: Read + Seek>(&self, archive: &mut Archive<R>) -> Result<Parameters, CheckpointError> {
        let count = self.count;
        let mut parameters = Parameters {
            mean: archive.rows(self.mean, count)?,
            log_scale: archive.rows(self.log_scale, count)?,
            rotation_l: rotations(archive, self.rotation_l, count)?,
            opacity_logit: archive.rows::<1>(self.opacity, count)?.into_flattened(),
            ..Parameters::default()
        };
        if let Some([mean_t, log_scale_t]) = self.temporal {
            parameters.mean_t = archive.rows::<1>(mean_t, count)?.into_flattened();
            parameters.log_scale_t = archive.rows::<1>(log_scale_t, count)?.into_flattened();
        }
        if let Some(rotation_r) = self.rotation_r {
            parameters.rotation_r = rotations(archive, rotation_r, count)?;
        }
        Ok(parameters)
    }

    /// Reads the color coefficients: the first from one tensor, the others from another, interleaved per Gaussian.
    ///
    /// # Errors
    /// Tensors of other shapes or that cannot be read; too few coefficients for the degrees; numbers not finite.
    pub(super) fn harmonics<R: Read + Seek>(
        &self,
        archive: &mut Archive<R>,
        force_sh_3d: bool,
    ) -> Result<Harmonics, CheckpointError> {
        let rest = match self.features_rest.tensor.size[..] {
            // Below 48, so the cast is lossless.
            [_, rest, 3] if rest < COEFFICIENTS => rest as usize,
            _ => {
                return Err(self
                    .features_rest
                    .shape_error(format!("[{}, K - 1, 3] with K up to {COEFFICIENTS}", self.count)));
            }
        };
        // Time blocks exist at degree 3 only.
        let degree_t = if force_sh_3d || self.degree < 3 { 0 } else { self.degree_t };
        let mut harmonics = Harmonics { coefficients: rest + 1, degree: self.degree, degree_t, values: Vec::new() };
        let needed = harmonics.evaluated();
        if needed > harmonics.coefficients {
            return Err(CheckpointError::Layout(format!(
                "slot 3 (_features_rest) gives {} coefficients per channel, and the active degrees {} and {degree_t} need {needed}",
                harmonics.coefficients, self.degree
            )));
        }
        let dc = archive.locate(self.features_dc, &[self.count, 1, 3])?;
        let others = archive.locate(self.features_rest, &[self.count, rest, 3])?;
        // Both tensors are in the file, so their values together are at most twice as many as fit in the file.
        let pitch = harmonics.coefficients * 3;
        harmonics.values = vec![0.0; self.count * pitch];
        archive.fill(&dc, Rows { values: &mut harmonics.values, pitch, start: 0, width: 3 })?;
        archive.fill(&others, Rows { values: &mut harmonics.values, pitch, start: 3, width: rest * 3 })?;
        Ok(harmonics)
    }

    /// Reads the environment map; `None` if there is none.
    ///
    /// # Errors
    /// A tensor that cannot be read, a value that is not finite.
    pub(super) fn environment<R: Read + Seek>(
        &self,
        archive: &mut Archive<R>,
    ) -> Result<Option<Environment>, CheckpointError> {
        let Some(slot) = self.environment else { return Ok(None) };
        // At most 16,384, which was checked with the slot.
        let edge = slot.tensor.size.last().map_or(0, |&edge| edge as u32);
        let plane = edge as usize * edge as usize;
        let located = archive.locate(slot, &[3, edge as usize, edge as usize])?;
        let mut texels = vec![0.0; 3 * plane];
        archive.fill(&located, Rows { values: &mut texels, pitch: plane, start: 0, width: plane })?;
        Ok(Some(Environment { width: edge, height: edge, texels }))
    }
}

/// Returns the outermost pair: state tuple and iteration.
fn pair<'p>(pickle: &'p Pickle<'p>) -> Result<(Slots<'p>, u64), CheckpointError> {
    let layout = |found: String| {
        CheckpointError::Layout(format!(
            "the file holds {found}, expected the pair (state, iteration) that the 4DGS trainer writes to chkpnt*.pth, or the Gaussians of \
             gsplat or nerfstudio; export them as PLY with the program that trained them"
        ))
    };
    if matches!(pickle.root(), Value::Dict(_)) {
        let keys: Vec<&str> = pickle.entries(pickle.root()).map(|(key, _)| key).take(KEYS).collect();
        return Err(layout(match keys[..] {
            [] => "a dictionary without names".to_owned(),
            _ => format!("a dictionary of {}", printable(&keys.join(", "))),
        }));
    }
    let Value::Tuple(items) = pickle.root() else { return Err(layout(pickle.root().kind().to_owned())) };
    let &[state, iteration] = items.as_slice() else {
        return Err(layout(format!("a tuple of {} values", items.len())));
    };
    let (Value::Tuple(ids), &Value::Int(iteration)) = (pickle.get(state), pickle.get(iteration)) else {
        let (state, iteration) = (pickle.get(state).kind(), pickle.get(iteration).kind());
        return Err(layout(format!("a pair of {state} and {iteration}")));
    };
    if ids.len() < 12 {
        return Err(CheckpointError::Layout(format!(
            "the state has {} entries, expected 12 (3D) or 19 (4D)",
            ids.len()
        )));
    }
    let negative = |_| CheckpointError::Layout(format!("iteration {iteration} is negative"));
    let iteration = u64::try_from(iteration).map_err(negative)?;
    Ok((Slots { pickle, ids }, iteration))
}

/// Reads a tensor of N × 4 quaternions and checks that none has length zero.
fn rotations<R: Read + Seek>(
    archive: &mut Archive<R>,
    slot: Slot,
    count: usize,
) -> Result<Vec<[f32; 4]>, CheckpointError> {
    let rows = archive.rows::<4>(slot, count)?;
    let square = |q: &[f32; 4]| q.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>();
    // 1e-12 is the length below which the trainer no longer normalizes.
    match rows.iter().position(|q| square(q) <= 1e-24) {
        Some(at) => Err(CheckpointError::ZeroRotation { name: slot.name, at }),
        None => Ok(rows),
    }
}
