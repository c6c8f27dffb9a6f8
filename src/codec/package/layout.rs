//! The values of a scene in memory, as tables of words.
//!
//! In: a [`Header`] or a scene, and the words of its colliders, which are not values of the scene. Out: a blank scene
//! of the header's size, made at once or in steps, and the 32-bit words of each attribute of a scene.

use super::colliders::{ColliderWords, StoredColliders};
use super::header::{Header, StoredForm};
use crate::gaussian::{Harmonics, Model, Parameters};
use crate::scene::{
    ActiveSets, CodedColors, ColorCodebooks, Environment, Form, GaussianScene, PackedColors, PackedScene, SceneForm,
    Sliced, SoundFile, TemporalFilter, Trained,
};
use bytemuck::{Zeroable, cast_slice, cast_slice_mut};
use std::sync::Arc;

/// Returns a scene of the header's form without values, which [`grow`] adds, and without colliders. The header must
/// have been checked.
pub(super) fn empty(header: &Header) -> GaussianScene {
    let harmonics = Harmonics {
        coefficients: header.coefficients,
        degree: header.degree,
        degree_t: header.degree_t,
        values: Vec::new(),
    };
    let form = match header.form {
        StoredForm::Trained { .. } => SceneForm::Trained(Trained { parameters: Parameters::default(), harmonics }),
        StoredForm::Sliced => SceneForm::Ready(Form::Sliced(Sliced { gaussians: Vec::new(), harmonics })),
        StoredForm::Packed { codebooks } => SceneForm::Ready(Form::Packed(PackedScene {
            records: Vec::new(),
            ranges: Vec::new(),
            layers: header.layers.clone(),
            runs: header.runs.clone(),
            colors: match codebooks {
                None => PackedColors::Whole(harmonics),
                Some(entries) => PackedColors::Coded(CodedColors {
                    degree: header.degree,
                    degree_t: header.degree_t,
                    records: Vec::new(),
                    codebooks: Arc::new(ColorCodebooks {
                        entries: entries.into_iter().filter(|&entries| entries > 0).collect(),
                        ..ColorCodebooks::default()
                    }),
                }),
            },
        })),
    };
    GaussianScene {
        form,
        filter: header.filter.map(|filter| {
            let sets = if filter.bits { ActiveSets::Bits(Vec::new()) } else { ActiveSets::Intervals(Vec::new()) };
            TemporalFilter { kind: filter.kind, segments: filter.segments, count: header.gaussians, sets }
        }),
        environment: header.environment.map(|size| Environment {
            width: size.width,
            height: size.height,
            texels: Vec::new(),
        }),
        trained_with: header.trained_with.clone(),
        playback: header.playback,
        levels: Vec::new(),
        sockets: header.sockets.clone(),
        colliders: None,
        sound: header.sound.map(|length| Arc::new(SoundFile::blank(length))),
        chunks: header.chunks.clone().map(Arc::new),
    }
}

/// Adds values of zero to an [`empty`] scene and to the words of its colliders, about `bytes` at most. Returns whether
/// they have the header's size.
pub(super) fn grow(scene: &mut GaussianScene, colliders: &mut ColliderWords, header: &Header, bytes: usize) -> bool {
    let (count, mut zeros) = (header.gaussians, Zeros { left: bytes, complete: true });
    let colors = count * header.coefficients * 3;
    match &mut scene.form {
        SceneForm::Trained(Trained { parameters, harmonics }) => {
            let model = match header.form {
                StoredForm::Trained { model } => model,
                StoredForm::Sliced | StoredForm::Packed { .. } => Model::Static3d,
            };
            let timed = if model == Model::Static3d { 0 } else { count };
            zeros.fill(&mut parameters.mean, count);
            zeros.fill(&mut parameters.mean_t, timed);
            zeros.fill(&mut parameters.log_scale, count);
            zeros.fill(&mut parameters.log_scale_t, timed);
            zeros.fill(&mut parameters.rotation_l, count);
            zeros.fill(&mut parameters.rotation_r, if model == Model::Rotated4d { count } else { 0 });
            zeros.fill(&mut parameters.opacity_logit, count);
            zeros.fill(&mut harmonics.values, colors);
        }
        SceneForm::Ready(Form::Sliced(Sliced { gaussians, harmonics })) => {
            zeros.fill(gaussians, count);
            zeros.fill(&mut harmonics.values, colors);
        }
        SceneForm::Ready(Form::Packed(packed)) => {
            zeros.fill(&mut packed.records, count);
            zeros.fill(&mut packed.ranges, PackedScene::range_count(count));
            match &mut packed.colors {
                PackedColors::Whole(harmonics) => zeros.fill(&mut harmonics.values, colors),
                PackedColors::Coded(coded) => {
                    let words = coded.words_per_entry();
                    zeros.fill(&mut coded.records, count);
                    if !header.codebooks_in_index {
                        let codebooks = Arc::make_mut(&mut coded.codebooks);
                        let (entries, stages) = (codebooks.total(), codebooks.entries.len());
                        zeros.fill(&mut codebooks.words, entries * words);
                        zeros.fill(&mut codebooks.scales, stages * words);
                    }
                }
            }
        }
    }
    match scene.filter.as_mut().map(|filter| (filter.segments as usize, &mut filter.sets)) {
        Some((segments, ActiveSets::Bits(words))) => zeros.fill(words, TemporalFilter::words(count) * segments),
        Some((_, ActiveSets::Intervals(intervals))) => zeros.fill(intervals, count),
        None => {}
    }
    if let Some(map) = &mut scene.environment {
        zeros.fill(&mut map.texels, 3 * map.width as usize * map.height as usize);
    }
    if let Some([points, triangles]) = header.colliders.as_ref().map(StoredColliders::counts) {
        zeros.fill(&mut colliders.points, points);
        zeros.fill(&mut colliders.triangles, triangles);
    }
    if let Some(sound) = &mut scene.sound {
        let rows = sound.len().div_ceil(4);
        zeros.fill(Arc::make_mut(sound).words_mut(), rows);
    }
    zeros.complete
}

/// The bytes of zeros that may still be added in a step, and whether all tables so far are complete.
struct Zeros {
    left: usize,
    complete: bool,
}

impl Zeros {
    /// Grows a table towards `count` rows, by one at least: a step may be smaller.
    fn fill<T: Zeroable + Clone>(&mut self, table: &mut Vec<T>, count: usize) {
        let (row, missing) = (size_of::<T>(), count.saturating_sub(table.len()));
        let rows = if self.complete { missing.min((self.left / row).max(1)) } else { 0 };
        if rows == count {
            // The system provides zeroed memory at no cost.
            *table = vec![T::zeroed(); count];
        } else if rows > 0 {
            table.reserve_exact(missing);
            table.resize(table.len() + rows, T::zeroed());
        }
        self.left = self.left.saturating_sub(rows * row);
        self.complete &= rows == missing;
    }
}

/// Returns the table of words that contains the attribute of this name; empty if the scene has no such attribute. Words
/// rather than floats, so that NaN payloads are preserved.
pub(super) fn words<'a>(scene: &'a GaussianScene, colliders: &'a ColliderWords, name: &str) -> &'a [u32] {
    match name {
        "collider_points" => cast_slice(&colliders.points),
        "collider_triangles" => cast_slice(&colliders.triangles),
        "sound" => scene.sound.as_ref().map(|sound| sound.words()).unwrap_or_default(),
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
        ("codebooks", PackedColors::Coded(colors)) => &colors.codebooks.words,
        ("codebook_scales", PackedColors::Coded(colors)) => cast_slice(&colors.codebooks.scales),
        _ => &[],
    }
}

/// Returns the same as [`words`], mutable.
pub(super) fn words_mut<'a>(
    scene: &'a mut GaussianScene,
    colliders: &'a mut ColliderWords,
    name: &str,
) -> &'a mut [u32] {
    match name {
        "collider_points" => cast_slice_mut(&mut colliders.points),
        "collider_triangles" => cast_slice_mut(&mut colliders.triangles),
        "sound" => match &mut scene.sound {
            Some(sound) => Arc::make_mut(sound).words_mut(),
            None => &mut [],
        },
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
        ("codebooks", PackedColors::Coded(colors)) => &mut Arc::make_mut(&mut colors.codebooks).words,
        ("codebook_scales", PackedColors::Coded(colors)) => {
            cast_slice_mut(&mut Arc::make_mut(&mut colors.codebooks).scales)
        }
        _ => &mut [],
    }
}
