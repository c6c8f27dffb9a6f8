//! Attributes: the sections of a scene, and where their values are in memory.
//!
//! In: a [`Header`]. Out: its [`Attribute`]s in the order of the file, a blank scene of its size, and the 32-bit words
//! of each attribute.

use super::{FLOAT_PLANES, Header, PackageError, Section, StoredForm};
use crate::gaussian::{Gaussian, Harmonics, Model, Parameters};
use crate::scene::packed::{COLOR_WORDS, RECORD_WORDS};
use crate::scene::{
    ActiveSets, CodedColors, Environment, Form, GaussianScene, PackedColors, PackedScene, SceneForm, Sliced,
    TemporalFilter, Trained,
};
use bytemuck::{Zeroable, cast_slice, cast_slice_mut};
use std::ops::Range;

/// One attribute of all Gaussians: a column of a table of words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Attribute {
    /// Name of its sections.
    pub name: &'static str,
    /// Rows of the table: Gaussians, or values of the environment map.
    pub rows: usize,
    /// Number of words from one row to the next in memory.
    pub stride: usize,
    /// First word of the attribute within a row.
    pub offset: usize,
    /// Number of words of the attribute in a row.
    pub width: usize,
}

impl Attribute {
    /// Returns the bytes of its table in memory, which count with the first of the attributes that share it.
    pub fn memory(&self) -> u64 {
        if self.offset > 0 { 0 } else { (self.rows as u64).saturating_mul(self.stride as u64).saturating_mul(4) }
    }

    /// Returns the uncompressed bytes of `rows` rows.
    pub fn raw_length(&self, rows: usize) -> u64 {
        (rows as u64).saturating_mul(self.width as u64 * 4)
    }

    /// Returns its rows in runs of at most `length`.
    pub fn runs(self, length: usize) -> impl Iterator<Item = (Self, Range<usize>)> {
        (0..self.rows).step_by(length).map(move |first| (self, first..self.rows.min(first.saturating_add(length))))
    }

    /// Checks that the sections of this name hold every row once, in order.
    pub fn check_sections(&self, sections: &[Section]) -> Result<(), PackageError> {
        let mut next = 0;
        for section in sections.iter().filter(|section| section.name == self.name) {
            let name = section.name.clone();
            if section.encoding != FLOAT_PLANES {
                return Err(PackageError::UnknownEncoding { name, encoding: section.encoding.clone() });
            }
            if section.first != next || section.count > self.rows - next {
                let (found, count) = (section.first, section.count);
                return Err(PackageError::SectionRange { name, found, count, expected: next });
            }
            let (expected, found) = (self.raw_length(section.count), section.raw_length as u64);
            if expected != found {
                return Err(PackageError::SectionLength { name, expected, found });
            }
            next += section.count;
        }
        if next < self.rows {
            return Err(PackageError::MissingSection { name: self.name.to_owned() });
        }
        Ok(())
    }
}

impl Header {
    /// Returns the attributes of a scene with these numbers, in the order in which their sections are written.
    pub(super) fn attributes(&self) -> Vec<Attribute> {
        let rows = self.gaussians;
        let alone = |name, width| Attribute { name, rows, stride: width, offset: 0, width };
        let record = size_of::<Gaussian>() / 4;
        let within = |name, offset, width| Attribute { name, rows, stride: record, offset, width };
        let mut attributes: Vec<Attribute> = match self.form {
            StoredForm::Trained { model } => {
                let timed = model != Model::Static3d;
                let pairs = model == Model::Rotated4d;
                [
                    Some(alone("mean", 3)),
                    timed.then(|| alone("mean_t", 1)),
                    Some(alone("log_scale", 3)),
                    timed.then(|| alone("log_scale_t", 1)),
                    Some(alone("rotation_l", 4)),
                    pairs.then(|| alone("rotation_r", 4)),
                    Some(alone("opacity_logit", 1)),
                ]
                .into_iter()
                .flatten()
                .collect()
            }
            StoredForm::Sliced => vec![
                within("mean", 0, 3),
                within("mean_t", 3, 1),
                within("velocity", 4, 3),
                within("sigma_t", 7, 1),
                within("covariance", 8, 6),
                within("opacity", 14, 1),
            ],
            StoredForm::Packed { .. } => {
                let lanes = |name, offset, width| Attribute { name, rows, stride: RECORD_WORDS, offset, width };
                let ranges = PackedScene::range_count(rows);
                vec![
                    lanes("packed_mean", 0, 2),
                    lanes("packed_motion", 2, 2),
                    lanes("packed_shape", 4, 4),
                    Attribute { name: "packed_ranges", rows: ranges, stride: 4, offset: 0, width: 4 },
                ]
            }
        };
        let stride = self.coefficients.saturating_mul(3);
        let color = |name, offset, width| Attribute { name, rows, stride, offset, width };
        if let StoredForm::Packed { codebooks: Some(entries) } = self.form {
            let stages = entries.iter().filter(|&&entries| entries > 0).count();
            let total = entries.iter().fold(0usize, |sum, &entries| sum.saturating_add(entries as usize));
            let words = stride.div_ceil(4);
            let record = |name, offset, width| Attribute { name, rows, stride: COLOR_WORDS, offset, width };
            attributes.push(record("color_base", 0, 1));
            if stages > 0 {
                attributes.push(record("color_codes", 1, stages.div_ceil(2)));
                attributes.push(Attribute { name: "codebooks", rows: total, stride: words, offset: 0, width: words });
                let scales = stages * words;
                attributes.push(Attribute { name: "codebook_scales", rows: scales, stride: 4, offset: 0, width: 4 });
            }
        } else {
            attributes.push(color("sh_dc", 0, 3));
            if stride > 3 {
                attributes.push(color("sh_rest", 3, stride - 3));
            }
        }
        if let Some(filter) = self.filter {
            let words = TemporalFilter::words(rows).saturating_mul(filter.segments as usize);
            let rows = if filter.bits { words } else { rows };
            attributes.push(Attribute { name: "filter", rows, stride: 1, offset: 0, width: 1 });
        }
        if let Some(size) = self.environment {
            let texels = (size.width as usize).saturating_mul(size.height as usize);
            let rows = texels.saturating_mul(3);
            attributes.push(Attribute { name: "environment", rows, stride: 1, offset: 0, width: 1 });
        }
        attributes
    }

    /// Checks that the scene has exactly the values that these numbers require.
    pub(super) fn check_scene(&self, scene: &GaussianScene) -> Result<(), PackageError> {
        let fits = |a: &Attribute| a.rows.checked_mul(a.stride) == Some(words(scene, a.name).len());
        if !self.attributes().iter().all(fits) {
            return Err(PackageError::Inconsistent("the attributes of the scene differ in length"));
        }
        match &scene.form {
            SceneForm::Trained(Trained { parameters: p, .. })
                if p.mean_t.is_empty() && !(p.log_scale_t.is_empty() && p.rotation_r.is_empty()) =>
            {
                Err(PackageError::Inconsistent("the scene has attributes of a 4D model but no temporal means"))
            }
            SceneForm::Trained(_) | SceneForm::Ready(_) => Ok(()),
        }
    }
}

/// Returns a scene of the header's size with all values zero. The header must have been checked.
pub(super) fn blank(header: &Header) -> GaussianScene {
    let count = header.gaussians;
    let harmonics = || Harmonics {
        coefficients: header.coefficients,
        degree: header.degree,
        degree_t: header.degree_t,
        values: vec![0.0; count * header.coefficients * 3],
    };
    let form = match header.form {
        StoredForm::Trained { model } => {
            let timed = if model == Model::Static3d { 0 } else { count };
            let pairs = if model == Model::Rotated4d { count } else { 0 };
            let parameters = Parameters {
                mean: vec![[0.0; 3]; count],
                mean_t: vec![0.0; timed],
                log_scale: vec![[0.0; 3]; count],
                log_scale_t: vec![0.0; timed],
                rotation_l: vec![[0.0; 4]; count],
                rotation_r: vec![[0.0; 4]; pairs],
                opacity_logit: vec![0.0; count],
            };
            SceneForm::Trained(Trained { parameters, harmonics: harmonics() })
        }
        StoredForm::Sliced => SceneForm::Ready(Form::Sliced(Sliced {
            gaussians: vec![Gaussian::zeroed(); count],
            harmonics: harmonics(),
        })),
        StoredForm::Packed { codebooks } => SceneForm::Ready(Form::Packed(PackedScene {
            records: vec![[0; RECORD_WORDS]; count],
            ranges: vec![[0.0; 4]; PackedScene::range_count(count)],
            colors: match codebooks {
                None => PackedColors::Whole(harmonics()),
                Some(entries) => PackedColors::Coded(blank_colors(header, &entries)),
            },
        })),
    };
    GaussianScene {
        form,
        filter: header.filter.map(|filter| {
            let words = TemporalFilter::words(count) * filter.segments as usize;
            let bits = || ActiveSets::Bits(vec![0; words]);
            let sets = if filter.bits { bits() } else { ActiveSets::Intervals(vec![0; count]) };
            TemporalFilter { kind: filter.kind, segments: filter.segments, count, sets }
        }),
        environment: header.environment.map(|size| Environment {
            width: size.width,
            height: size.height,
            texels: vec![0.0; 3 * size.width as usize * size.height as usize],
        }),
        trained_with: header.trained_with.clone(),
        playback: header.playback,
        levels: Vec::new(),
    }
}

fn blank_colors(header: &Header, entries: &[u32]) -> CodedColors {
    let entries: Vec<u32> = entries.iter().copied().filter(|&entries| entries > 0).collect();
    let total: usize = entries.iter().map(|&entries| entries as usize).sum();
    let mut colors = CodedColors { degree: header.degree, degree_t: header.degree_t, ..CodedColors::default() };
    let words = colors.words_per_entry();
    colors.records = vec![[0; COLOR_WORDS]; header.gaussians];
    colors.codebooks = vec![0; total * words];
    colors.scales = vec![[0.0; 4]; entries.len() * words];
    colors.entries = entries;
    colors
}

/// Returns the table of words that contains the attribute of this name; empty if the scene has no such attribute. Words
/// rather than floats, so that NaN payloads are preserved.
pub(super) fn words<'a>(scene: &'a GaussianScene, name: &str) -> &'a [u32] {
    match name {
        "filter" => match scene.filter.as_ref().map(|filter| &filter.sets) {
            Some(ActiveSets::Bits(words) | ActiveSets::Intervals(words)) => words,
            None => &[],
        },
        "environment" => scene.environment.as_ref().map(|map| cast_slice(&map.texels)).unwrap_or_default(),
        "sh_dc" | "sh_rest" => scene.form.harmonics().map(|all| cast_slice(&all.values)).unwrap_or_default(),
        _ => match &scene.form {
            SceneForm::Trained(trained) => words_of_parameters(&trained.parameters, name),
            SceneForm::Ready(Form::Sliced(sliced)) => cast_slice(&sliced.gaussians),
            SceneForm::Ready(Form::Packed(packed)) => words_of_packed(packed, name),
        },
    }
}

fn words_of_parameters<'a>(parameters: &'a Parameters, name: &str) -> &'a [u32] {
    match name {
        "mean" => cast_slice(&parameters.mean),
        "mean_t" => cast_slice(&parameters.mean_t),
        "log_scale" => cast_slice(&parameters.log_scale),
        "log_scale_t" => cast_slice(&parameters.log_scale_t),
        "rotation_l" => cast_slice(&parameters.rotation_l),
        "rotation_r" => cast_slice(&parameters.rotation_r),
        "opacity_logit" => cast_slice(&parameters.opacity_logit),
        _ => &[],
    }
}

fn words_of_packed<'a>(packed: &'a PackedScene, name: &str) -> &'a [u32] {
    match (name, &packed.colors) {
        ("packed_mean" | "packed_motion" | "packed_shape", _) => cast_slice(&packed.records),
        ("packed_ranges", _) => cast_slice(&packed.ranges),
        ("color_base" | "color_codes", PackedColors::Coded(colors)) => cast_slice(&colors.records),
        ("codebooks", PackedColors::Coded(colors)) => &colors.codebooks,
        ("codebook_scales", PackedColors::Coded(colors)) => cast_slice(&colors.scales),
        _ => &[],
    }
}

/// Returns the same as [`words`], mutable.
pub(super) fn words_mut<'a>(scene: &'a mut GaussianScene, name: &str) -> &'a mut [u32] {
    match name {
        "filter" => match scene.filter.as_mut().map(|filter| &mut filter.sets) {
            Some(ActiveSets::Bits(words) | ActiveSets::Intervals(words)) => words,
            None => &mut [],
        },
        "environment" => scene.environment.as_mut().map(|map| cast_slice_mut(&mut map.texels)).unwrap_or_default(),
        "sh_dc" | "sh_rest" => {
            scene.form.harmonics_mut().map(|all| cast_slice_mut(&mut all.values)).unwrap_or_default()
        }
        _ => match &mut scene.form {
            SceneForm::Trained(trained) => words_of_parameters_mut(&mut trained.parameters, name),
            SceneForm::Ready(Form::Sliced(sliced)) => cast_slice_mut(&mut sliced.gaussians),
            SceneForm::Ready(Form::Packed(packed)) => words_of_packed_mut(packed, name),
        },
    }
}

fn words_of_parameters_mut<'a>(parameters: &'a mut Parameters, name: &str) -> &'a mut [u32] {
    match name {
        "mean" => cast_slice_mut(&mut parameters.mean),
        "mean_t" => cast_slice_mut(&mut parameters.mean_t),
        "log_scale" => cast_slice_mut(&mut parameters.log_scale),
        "log_scale_t" => cast_slice_mut(&mut parameters.log_scale_t),
        "rotation_l" => cast_slice_mut(&mut parameters.rotation_l),
        "rotation_r" => cast_slice_mut(&mut parameters.rotation_r),
        "opacity_logit" => cast_slice_mut(&mut parameters.opacity_logit),
        _ => &mut [],
    }
}

fn words_of_packed_mut<'a>(packed: &'a mut PackedScene, name: &str) -> &'a mut [u32] {
    match (name, &mut packed.colors) {
        ("packed_mean" | "packed_motion" | "packed_shape", _) => cast_slice_mut(&mut packed.records),
        ("packed_ranges", _) => cast_slice_mut(&mut packed.ranges),
        ("color_base" | "color_codes", PackedColors::Coded(colors)) => cast_slice_mut(&mut colors.records),
        ("codebooks", PackedColors::Coded(colors)) => &mut colors.codebooks,
        ("codebook_scales", PackedColors::Coded(colors)) => cast_slice_mut(&mut colors.scales),
        _ => &mut [],
    }
}
