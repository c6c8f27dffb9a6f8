//! The values of a scene in memory, as tables of words.
//!
//! In: a [`Header`] or a scene. Out: a blank scene of the header's size, and the 32-bit words of each attribute of a
//! scene.

use super::header::{Header, StoredForm};
use crate::gaussian::{Gaussian, Harmonics, Model, Parameters};
use crate::scene::packed::{COLOR_WORDS, RECORD_WORDS};
use crate::scene::{
    ActiveSets, CodedColors, Environment, Form, GaussianScene, PackedColors, PackedScene, SceneForm, Sliced,
    TemporalFilter, Trained,
};
use bytemuck::{Zeroable, cast_slice, cast_slice_mut};

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
