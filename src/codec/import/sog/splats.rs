//! The attributes that all formats of the SOG family have, from textures to columns.
//!
//! In: the names of the textures and the meaning of their codes, the textures. Out: [`Columns`] of Gaussians at rest,
//! without those whose opacity is 0: writers do not keep their colors.

use super::files::Files;
use super::meta::{Coded, Images, Palette, Wide};
use super::textures::{Encoded, Texture};
use crate::codec::import::ImportError;
use crate::codec::import::columns::{Columns, logit};
use crate::gaussian::Harmonics;
use rayon::prelude::*;
use std::f64::consts::SQRT_2;
use std::ops::Range;

/// The alpha of a texel with a rotation whose first component, w, is left out.
const FIRST_LEFT_OUT: u8 = 252;
/// Centroids in a row of their texture.
const IN_A_ROW: usize = 64;
/// Largest number of centroids: labels have 16 bits.
const MOST_CENTROIDS: usize = 1 << 16;

/// The values of the 256 codes of a byte; not a number for codes that have none.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    values: Vec<f32>,
}

/// The textures of the common attributes and the meaning of their codes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    /// Signed logarithms of the means.
    pub means: Wide,
    pub scales: String,
    /// Logarithms of the scales, for each axis.
    pub scale: [Table; 3],
    pub rotations: String,
    pub colors: String,
    /// Coefficients of degree 0, for each channel.
    pub color: [Table; 3],
    /// Logits of the opacities.
    pub opacity: Table,
    pub rest: Option<Rest>,
}

/// The textures of the coefficients of degree 1 and above.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rest {
    pub centroids: String,
    pub labels: String,
    /// Number of centroids and degree, if `meta.json` states them.
    pub stated: Option<(u64, u32)>,
    pub values: Table,
}

/// Coefficients of degree 1 and above, one set for each label.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Centroids {
    degree: u32,
    /// Values of a set.
    stride: usize,
    values: Vec<f32>,
}

impl Table {
    /// Returns the entries of a codebook. A first entry that is `null` continues the others, as PlayCanvas reads it.
    ///
    /// # Errors
    /// No entries or more than 256; an entry that is not a finite number.
    pub(super) fn of_codebook(name: &str, codebook: &[Option<f64>]) -> Result<Self, ImportError> {
        let damaged = |reason: &str| ImportError::damaged(format!("its meta.json has a codebook of {name} {reason}"));
        let first = match codebook {
            [None, Some(second), .., Some(last)] if codebook.len() == 256 => Some(second + (second - last) / 255.0),
            [first, ..] => *first,
            [] => return Err(damaged("without entries")),
        };
        if codebook.len() > 256 {
            return Err(damaged(&format!("of {} entries, more than the 256 codes of a byte", codebook.len())));
        }
        let others = codebook.get(1..).unwrap_or_default().iter().copied();
        let values: Option<Vec<f32>> = [first].into_iter().chain(others).map(|entry| Some(entry? as f32)).collect();
        let mut values = values.ok_or_else(|| damaged("with an entry that is no number"))?;
        if !values.iter().all(|value| value.is_finite()) {
            return Err(damaged("with an entry that is too large"));
        }
        values.resize(256, f32::NAN);
        Ok(Self { values })
    }

    /// Returns values at even distances between two limits.
    pub(super) fn between(least: f64, most: f64) -> Self {
        Self { values: (0..256).map(|code| (least + (most - least) * f64::from(code) / 255.0) as f32).collect() }
    }

    /// Returns the logits of opacities from 0 to 1 at even distances.
    fn of_opacities() -> Self {
        Self { values: (0..256).map(|code| logit(code as f32 / 255.0)).collect() }
    }

    /// Returns the value of a code.
    pub(super) fn at(&self, code: u8) -> f32 {
        self.values[usize::from(code)]
    }
}

impl Wide {
    /// Returns the three numbers of two texels.
    pub(super) fn linear(&self, low: [u8; 4], high: [u8; 4]) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let code = f64::from(u16::from_le_bytes([low[axis], high[axis]]));
            self.mins[axis] + (self.maxs[axis] - self.mins[axis]) * code / 65535.0
        })
    }

    /// Returns the three numbers whose signed logarithms are in two texels.
    pub(super) fn signed_log(&self, low: [u8; 4], high: [u8; 4]) -> [f32; 3] {
        self.linear(low, high).map(|log| log.abs().exp_m1().copysign(log) as f32)
    }
}

impl Layout {
    /// Returns the layout of version 2, which the moving formats have too.
    ///
    /// # Errors
    /// A codebook that is not usable.
    pub(super) fn of_images(images: Images) -> Result<Self, ImportError> {
        let Images { count: _, means, scales, quats, sh0, rest } = images;
        let three = |name, coded: &Coded| -> Result<[Table; 3], ImportError> {
            let table = Table::of_codebook(name, &coded.codebook)?;
            Ok([table.clone(), table.clone(), table])
        };
        let (scale, color) = (three("scales", &scales)?, three("sh0", &sh0)?);
        let rest = rest.map(|Palette { count, bands, codebook, files: [centroids, labels] }| {
            let values = Table::of_codebook("shN", &codebook)?;
            Ok::<_, ImportError>(Rest { centroids, labels, stated: Some((count, bands)), values })
        });
        let ([scales], [rotations], [colors]) = (scales.files, quats.files, sh0.files);
        let opacity = Table::of_opacities();
        Ok(Self { means, scales, scale, rotations, colors, color, opacity, rest: rest.transpose()? })
    }

    /// Returns the names of the textures with a texel for each Gaussian, in the order of [`columns`](Self::columns).
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        let [low, high] = &self.means.files;
        let labels = self.rest.as_ref().map(|rest| &rest.labels);
        [low, high, &self.scales, &self.rotations, &self.colors].into_iter().chain(labels).map(String::as_str)
    }

    /// Reads the texture of centroids, if there is one.
    ///
    /// # Errors
    /// As [`Encoded::read`] and [`Encoded::decode_if`]; a code without a value.
    pub(super) fn centroids(&self, files: &mut Files) -> Result<Centroids, ImportError> {
        let Some(Rest { centroids, stated, values: table, .. }) = &self.rest else { return Ok(Centroids::default()) };
        let degree = |width: usize| (1..=3).find(|&degree| width == IN_A_ROW * coefficients(degree));
        let texture = Encoded::read(files, centroids)?.decode_if(|width, height| {
            let degree = degree(width).ok_or("does not have 64 centroids of degree 1, 2 or 3 in a row")?;
            let (count, bands) = stated.unwrap_or((0, degree));
            let held = height.saturating_mul(IN_A_ROW);
            if bands != degree || count > held as u64 || held > MOST_CENTROIDS {
                return Err(format!("does not fit {count} centroids of degree {bands}"));
            }
            Ok(())
        })?;
        let degree = degree(texture.width).unwrap_or_default();
        let mut values: Vec<f32> = texture
            .texels
            .par_iter()
            .flat_map_iter(|&[red, green, blue, _]| [red, green, blue].map(|code| table.at(code)))
            .collect();
        let stride = coefficients(degree) * 3;
        if let Some((count, _)) = *stated {
            // The decoded texture has at least as many.
            values.truncate(count as usize * stride);
        }
        check_codes("shN", &values)?;
        Ok(Centroids { degree, stride, values })
    }

    /// Returns the columns of the Gaussians `kept`, from the textures of all of them.
    ///
    /// # Errors
    /// A code without a value, a label without a centroid, a texel that is no rotation.
    pub(super) fn columns(
        &self,
        textures: &[Texture],
        centroids: &Centroids,
        kept: &[u32],
    ) -> Result<Columns, ImportError> {
        let [low, high, scales, rotations, colors, labels @ ..] = textures else {
            return Err(ImportError::damaged("its textures are missing"));
        };
        let rotation: Option<Vec<[f32; 4]>> = kept.par_iter().map(|&i| rotation(rotations.at(i))).collect();
        let rotation = rotation.ok_or_else(|| {
            ImportError::damaged(format!("its texture {} has codes that are no rotation", self.rotations))
        })?;
        let mean = kept.par_iter().map(|&i| self.means.signed_log(low.at(i), high.at(i))).collect();
        let log_scale: Vec<[f32; 3]> = kept.par_iter().map(|&i| three(&self.scale, scales.at(i))).collect();
        check_codes("scales", log_scale.as_flattened())?;
        let opacity_logit = kept.par_iter().map(|&i| self.opacity.at(colors.at(i)[3])).collect();
        let stride = 3 + centroids.stride;
        let mut values = vec![0.0; kept.len() * stride];
        let has_label = |(own, &i): (&mut [f32], &u32)| -> bool {
            let (first, rest) = own.split_at_mut(3);
            first.copy_from_slice(&three(&self.color, colors.at(i)));
            let Some(labels) = labels.first() else { return true };
            let [low, high, ..] = labels.at(i);
            let start = usize::from(u16::from_le_bytes([low, high])) * centroids.stride;
            let set = centroids.values.get(start..start + centroids.stride);
            set.map(|set| rest.copy_from_slice(set)).is_some()
        };
        if !values.par_chunks_exact_mut(stride).zip(kept).map(has_label).all(|has_label| has_label) {
            return Err(ImportError::damaged("its texture of labels names a centroid that is not there"));
        }
        check_codes("sh0", &values)?;
        let harmonics = Harmonics { coefficients: stride / 3, degree: centroids.degree, degree_t: 0, values };
        Ok(Columns { mean, log_scale, rotation, opacity_logit, harmonics, ..Columns::default() })
    }
}

impl Texture {
    /// Returns the texel of a Gaussian.
    pub(super) fn at(&self, index: u32) -> [u8; 4] {
        self.texels[index as usize]
    }
}

/// Returns the Gaussians in a range whose opacity is not 0. `textures` are those of [`Layout::names`].
pub(super) fn visible(textures: &[Texture], range: Range<usize>) -> Vec<u32> {
    let colors = textures.get(4).and_then(|colors| colors.texels.get(range.clone())).unwrap_or_default();
    (range.start as u32..).zip(colors).filter(|(_, texel)| texel[3] != 0).map(|(index, _)| index).collect()
}

/// Checks that every code had a value.
///
/// # Errors
/// A value that is not a number.
pub(super) fn check_codes(name: &str, values: &[f32]) -> Result<(), ImportError> {
    if values.par_iter().any(|value| value.is_nan()) {
        return Err(ImportError::damaged(format!("its textures have a code beyond the end of the codebook of {name}")));
    }
    Ok(())
}

/// Returns the number of coefficients of degree 1 and above.
fn coefficients(degree: u32) -> usize {
    (degree as usize + 1).pow(2) - 1
}

fn three(tables: &[Table; 3], texel: [u8; 4]) -> [f32; 3] {
    std::array::from_fn(|channel| tables[channel].at(texel[channel]))
}

/// Returns the quaternion w, x, y, z of a texel, which has all components but the largest.
fn rotation([red, green, blue, largest]: [u8; 4]) -> Option<[f32; 4]> {
    let [a, b, c] = [red, green, blue].map(|code| (f64::from(code) / 255.0 - 0.5) * SQRT_2);
    let d = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    let quaternion = match largest.checked_sub(FIRST_LEFT_OUT)? {
        0 => [d, a, b, c],
        1 => [a, d, b, c],
        2 => [a, b, d, c],
        _ => [a, b, c, d],
    };
    Some(quaternion.map(|component| component as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_entry_that_is_null_continues_the_codebook() {
        let mut codebook: Vec<Option<f64>> = (0..256).map(|code| Some(f64::from(code))).collect();
        codebook[0] = None;
        let table = Table::of_codebook("scales", &codebook).expect("usable");
        assert!(table.at(0).abs() < 0.01, "0, 1, 2, ..: {}", table.at(0));
        assert_eq!(table.at(255), 255.0, "the others are as stored");
        codebook[3] = None;
        assert!(Table::of_codebook("scales", &codebook).is_err(), "another entry that is null");
    }

    #[test]
    fn codebooks_may_be_short_but_not_empty_or_long() {
        let table = Table::of_codebook("scales", &[Some(1.0), Some(2.0)]).expect("usable");
        assert_eq!((table.at(0), table.at(1)), (1.0, 2.0), "entries as stored");
        assert!(check_codes("scales", &[table.at(2)]).is_err(), "a code without an entry is found");
        for codebook in [vec![], vec![Some(0.0); 257], vec![Some(1e60)], vec![None]] {
            assert!(Table::of_codebook("scales", &codebook).is_err(), "{} entries", codebook.len());
        }
    }

    #[test]
    fn alpha_states_the_largest_component_of_a_rotation() {
        for largest in 0..4 {
            let found = rotation([128, 128, 128, FIRST_LEFT_OUT + largest]).expect("a rotation");
            for (axis, component) in found.into_iter().enumerate() {
                let expected = if axis == usize::from(largest) { 1.0 } else { 0.0 };
                assert!((component - expected).abs() < 0.01, "component {axis} of {found:?}");
            }
        }
        let [w, x, y, z] = rotation([255, 0, 128, 253]).expect("a rotation");
        assert!(w > 0.7 && x >= 0.0 && y < -0.7 && z.abs() < 0.01, "the others in their order: {w} {x} {y} {z}");
        assert_eq!(rotation([128, 128, 128, 251]), None, "not a rotation");
    }

    #[test]
    fn signed_logarithms_are_undone() {
        let wide = Wide { mins: [-2.0, 0.0, 1.0], maxs: [2.0, 0.0, 1.0], files: Default::default() };
        let [x, y, z] = wide.signed_log([0, 0, 9, 0], [0, 0, 9, 0]);
        assert!((x + (2f32.exp() - 1.0)).abs() < 1e-6, "the least value: {x}");
        assert!(y == 0.0 && (z - (1f32.exp() - 1.0)).abs() < 1e-6, "equal limits: {y} {z}");
    }
}
