//! Gaussians of other trainers: gsplat's `simple_trainer`, and splatfacto of nerfstudio.
//!
//! In: a [`Pickle`] whose outermost value is a dictionary. Out: [`Imported`]: Gaussians at rest in the space of their
//! training, and what the scene does not show.

use super::archive::{Archive, Rows, Slot};
use super::error::CheckpointError;
use super::pickle::{Pickle, Value};
use crate::codec::import::columns::{Columns, Played, coefficient, sigmoid};
use crate::codec::import::drawable::keep_drawable;
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;
use crate::gaussian::Harmonics;
use crate::scene::UpAxis;
use std::io::{Read, Seek};

/// Keys of the outermost dictionary below which the Gaussians are: of gsplat, of nerfstudio.
const PLACES: [&str; 2] = ["splats", "pipeline"];
/// The names of the means, of the first coefficient and of the others.
const MEANS: &str = "means";
const FIRST: [&str; 2] = ["sh0", "features_dc"];
const REST: [&str; 2] = ["shN", "features_rest"];
/// The base colors of gsplat, to which its network of appearance adds a correction.
const BASE: &str = "colors";
/// Most keys of means that are looked at; real files have one.
const PREFIXES: usize = 8;
/// Parts of keys of corrections that trainers learn beside the Gaussians.
const CORRECTIONS: [&str; 4] = ["app_module", "post_processing", "bil_grids", "appearance_embed"];

/// The Gaussians of a checkpoint, tensors not yet read.
pub(super) struct Splats<'p> {
    pickle: &'p Pickle<'p>,
    dictionary: &'p Value<'p>,
    /// Prefix of the keys of the tensors.
    prefix: &'p str,
}

impl<'p> Splats<'p> {
    /// Finds the Gaussians; `None` if the file has none of these trainers.
    pub(super) fn of(pickle: &'p Pickle<'p>) -> Option<Self> {
        let root = pickle.root();
        let mut places = PLACES.into_iter().filter_map(|key| pickle.entry(root, key)).chain([root]);
        places.find_map(|dictionary| {
            let prefixes = pickle.entries(dictionary).filter_map(|(key, _)| key.strip_suffix(MEANS));
            let mut prefixes = prefixes.filter(|prefix| prefix.is_empty() || prefix.ends_with('.')).take(PREFIXES);
            let prefix = prefixes.find(|prefix| {
                let has = |name: &str| pickle.entry(dictionary, &format!("{prefix}{name}")).is_some();
                ["quats", "scales", "opacities"].into_iter().all(has)
            })?;
            Some(Self { pickle, dictionary, prefix })
        })
    }

    /// Reads the scene.
    ///
    /// # Errors
    /// A tensor that is missing, has another shape or cannot be read; invalid options.
    pub(super) fn imported<R: Read + Seek>(
        &self,
        archive: &mut Archive<R>,
        options: &ReadOptions,
    ) -> Result<Imported, CheckpointError> {
        let means = self.needed(&[MEANS])?;
        let count = match means.tensor.size[..] {
            [count, 3] => usize::try_from(count).map_err(|_| means.shape_error("[N, 3]"))?,
            _ => return Err(means.shape_error("[N, 3]")),
        };
        let mut lost = Vec::new();
        let mut columns = Columns {
            mean: archive.any_rows(means, &[count, 3])?,
            log_scale: archive.any_rows(self.needed(&["scales"])?, &[count, 3])?,
            rotation: archive.any_rows(self.needed(&["quats"])?, &[count, 4])?,
            opacity_logit: rows::<1, R>(archive, self.needed(&["opacities"])?, count)?.into_flattened(),
            harmonics: self.harmonics(archive, count, &mut lost)?,
            ..Columns::default()
        };
        lost.extend(keep_drawable(&mut columns));
        self.state(options, &mut lost);
        let mut scene = columns.into_scene(Played::still(UpAxis::NegY), options).map_err(refused)?;
        scene.trained_with.iteration = self.step();
        Ok(Imported { scene, lost })
    }

    /// Reads the colors.
    fn harmonics<R: Read + Seek>(
        &self,
        archive: &mut Archive<R>,
        count: usize,
        lost: &mut Vec<String>,
    ) -> Result<Harmonics, CheckpointError> {
        if let Some(base) = self.tensor(&[BASE])? {
            lost.push(
                "Its colors are shown without the correction by gsplat's network of appearance, which is not read."
                    .to_owned(),
            );
            return Ok(plain(rows::<3, R>(archive, base, count)?.into_iter().map(|logits| logits.map(sigmoid))));
        }
        let (first, rest) = (self.needed(&FIRST)?, self.tensor(&REST)?);
        let more = match rest.map(|rest| &rest.tensor.size[..]) {
            None => 0,
            Some(&[_, more @ (0 | 3 | 8 | 15 | 24), 3]) => more as usize,
            Some(_) => {
                let expected = format!("[{count}, K, 3] with K of 0, 3, 8, 15 or 24");
                return Err(rest.map_or_else(|| self.missing(&REST), |rest| rest.shape_error(expected)));
            }
        };
        if more == 0 && first.name == FIRST[1] {
            // Without coefficients splatfacto learns the logits of colors.
            return Ok(plain(rows::<3, R>(archive, first, count)?.into_iter().map(|logits| logits.map(sigmoid))));
        }
        let (pitch, degree) = (3 * (more + 1), (more + 1).isqrt() as u32 - 1);
        let shape = shape_of(&first, count, 3);
        let dc = archive.locate(first, &shape)?;
        let others = rest.map(|rest| archive.locate(rest, &[count, more, 3])).transpose()?;
        // Both tensors are in the file, so that it has all of these values.
        let mut values = vec![0.0; count * pitch];
        archive.read(&dc, &mut Rows { values: &mut values, pitch, start: 0, width: 3 })?;
        if let Some(others) = others {
            archive.read(&others, &mut Rows { values: &mut values, pitch, start: 3, width: more * 3 })?;
        }
        let mut harmonics = Harmonics { coefficients: more + 1, degree: degree.min(3), degree_t: 0, values };
        if degree > 3 {
            lost.push(format!("The colors of degree 4, 9 coefficients of each of {count} Gaussians, are left out."));
            harmonics.truncate(3, 0);
        }
        Ok(harmonics)
    }

    /// Adds what the scene does not show, and what is assumed.
    fn state(&self, options: &ReadOptions, lost: &mut Vec<String>) {
        if options.up.is_none() {
            lost.push(
                "The file does not say which axis points up: -y, as in pictures of COLMAP, is assumed; gsplat and nerfstudio turn most scenes to +z \
                 (--up +z)."
                    .to_owned(),
            );
        }
        let keys = self.pickle.entries(self.pickle.root()).chain(self.pickle.entries(self.dictionary));
        let is_correction = |key: &str| CORRECTIONS.iter().any(|part| key.contains(part));
        if keys.map(|(key, _)| key).any(is_correction) {
            lost.push(
                "The corrections of single pictures that its training learned (appearance, exposure) are not applied."
                    .to_owned(),
            );
        }
    }

    /// Returns the step of the training; 0 if the file does not state it.
    fn step(&self) -> u64 {
        match self.pickle.entry(self.pickle.root(), "step") {
            Some(&Value::Int(step)) => step.try_into().unwrap_or(0),
            _ => 0,
        }
    }

    /// Returns the tensor of the first of these names that the dictionary has.
    ///
    /// # Errors
    /// A value that is no tensor of single precision.
    fn tensor(&self, names: &[&'static str]) -> Result<Option<Slot<'p>>, CheckpointError> {
        for &name in names {
            let Some(value) = self.pickle.entry(self.dictionary, &format!("{}{name}", self.prefix)) else { continue };
            let found = match value {
                Value::Tensor(tensor) => return Ok(Some(Slot { index: None, name, row: "Gaussian", tensor })),
                Value::Inert(object) => format!("the Python object `{object}`"),
                other => other.kind().to_owned(),
            };
            return Err(CheckpointError::Layout(format!(
                "{name} is {found}, expected a tensor of float32; convert it with .float() and save it again"
            )));
        }
        Ok(None)
    }

    /// As [`tensor`](Self::tensor), of a tensor that each checkpoint has.
    fn needed(&self, names: &[&'static str]) -> Result<Slot<'p>, CheckpointError> {
        self.tensor(names)?.ok_or_else(|| self.missing(names))
    }

    fn missing(&self, names: &[&str]) -> CheckpointError {
        let names: Vec<String> = names.iter().map(|name| format!("{}{name}", self.prefix)).collect();
        CheckpointError::Layout(format!("the Gaussians of the file have no {}", names.join(" and no ")))
    }
}

/// Returns the name of a file that another process of the same training wrote, with other Gaussians; `None` if `name`
/// is not that of one process.
pub(super) fn other_part(name: &str) -> Option<String> {
    let (before, after) = name.rsplit_once("_rank")?;
    let digits = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
    let rank: u32 = after[..digits].parse().ok()?;
    Some(format!("{before}_rank{}{}", if rank == 0 { 1 } else { 0 }, &after[digits..]))
}

/// Returns colors that do not depend on the direction, from channels from 0 to 1.
fn plain(colors: impl Iterator<Item = [f32; 3]>) -> Harmonics {
    let values = colors.flat_map(|color| color.map(coefficient)).collect();
    Harmonics { coefficients: 1, degree: 0, degree_t: 0, values }
}

/// Returns the shape of a tensor of `count` rows of `width` values, with an axis of length 1 if the tensor has one.
fn shape_of(slot: &Slot<'_>, count: usize, width: usize) -> Vec<usize> {
    match (slot.tensor.size.len(), width) {
        (1, 1) => vec![count],
        (3, _) => vec![count, 1, width],
        _ => vec![count, width],
    }
}

/// Reads rows of `W` values.
fn rows<const W: usize, R: Read + Seek>(
    archive: &mut Archive<R>,
    slot: Slot<'_>,
    count: usize,
) -> Result<Vec<[f32; W]>, CheckpointError> {
    archive.any_rows(slot, &shape_of(&slot, count, W))
}

/// Returns the error of Gaussians that do not make a scene.
fn refused(error: ImportError) -> CheckpointError {
    match error {
        ImportError::Option(option) => option.into(),
        error => CheckpointError::Layout(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_another_process_is_named() {
        for (name, expected) in [
            ("ckpt_29999_rank0.pt", Some("ckpt_29999_rank1.pt")),
            ("ckpt_6_rank3.pt", Some("ckpt_6_rank0.pt")),
            ("ckpt_6.pt", None),
            ("a_rank.pt", None),
        ] {
            assert_eq!(other_part(name).as_deref(), expected, "{name}");
        }
    }
}
