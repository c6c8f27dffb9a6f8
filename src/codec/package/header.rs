//! The header: the contents of a package and their location.
//!
//! In: a scene, or the RON text of a file. Out: a [`Header`], its RON text, and the [`Attribute`]s that it describes,
//! in the order of the file. `check.rs` has its checks.

use super::attribute::Attribute;
use super::colliders::StoredColliders;
use super::error::PackageError;
use super::section::Section;
use crate::gaussian::{Gaussian, MARGINAL_CUTOFF, Model};
use crate::scene::packed::{COLOR_WORDS, MAX_STAGES, RECORD_WORDS};
use crate::scene::{
    ActiveSets, ChunkFile, ChunkTable, ColorDegrees, FilterKind, Form, GaussianScene, PackedColors, PackedScene,
    PlaybackHints, Runs, SceneForm, Socket, TemporalFilter, Trained, TrainedWith,
};
use crate::view::NEAR;
use serde::{Deserialize, Serialize};

/// The header of a package. Fields that a reader does not know are ignored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The program that wrote the package, for display.
    #[serde(default)]
    pub generator: String,
    /// Features that a reader must know to read the package correctly. A reader refuses unknown features.
    #[serde(default)]
    pub requires: Vec<String>,
    /// The form of the Gaussians.
    pub form: StoredForm,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Color coefficients stored per Gaussian and channel, K.
    pub coefficients: usize,
    /// Spatial degree of the color, 0 to 3.
    pub degree: u32,
    /// Time degree of the color, 0 to 2.
    pub degree_t: u32,
    /// Size of the environment map, if there is one.
    #[serde(default)]
    pub environment: Option<EnvironmentSize>,
    /// The temporal filter, if there is one.
    #[serde(default)]
    pub filter: Option<StoredFilter>,
    /// The settings the capture was trained with.
    pub trained_with: TrainedWith,
    /// How the capture is meant to be played.
    pub playback: PlaybackHints,
    /// Numbers of Gaussians up to the ends of the layers but the last ([`PackedScene::layers`]). Empty: one layer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<usize>,
    /// Which Gaussians are in which chunk file ([`PackedScene::runs`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub runs: Option<Runs>,
    /// Whether the package is a chunk file whose codebooks are in the index beside it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub codebooks_in_index: bool,
    /// The levels of detail, finest first. Each is a section `level` of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<StoredLevel>,
    /// Named points that follow a part of the capture. Levels of detail have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sockets: Vec<Socket>,
    /// Meshes of the solid parts, without their points and triangles. Levels of detail have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colliders: Option<StoredColliders>,
    /// Number of bytes of the sound file, if there is one. Levels of detail have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sound: Option<usize>,
    /// The chunk files that have the Gaussians, if the package is the index of a capture in chunk files. Levels of
    /// detail have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chunks: Option<ChunkTable>,
    /// Whether the chunk files follow the last section in their order, each a package.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub chunks_follow: bool,
    /// The section table, in the order of the file.
    pub sections: Vec<Section>,
}

/// The name of the sections of levels of detail.
pub(super) const LEVEL: &str = "level";

/// A level of detail, without its Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StoredLevel {
    /// The largest size on the screen at which it is drawn, pixels.
    pub pixels: f32,
}

/// The form in which the Gaussians are stored: a [`SceneForm`] without its values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StoredForm {
    /// As an optimizer stores them: raw parameters.
    Trained {
        /// The model they belong to.
        model: Model,
    },
    /// Sliced, ready to draw.
    #[serde(rename = "runtime")]
    Sliced,
    /// Sliced and quantized.
    Packed {
        /// Number of entries of each codebook of color; `None` if the coefficients are whole.
        codebooks: Option<[u32; MAX_STAGES]>,
    },
}

impl StoredForm {
    /// Returns the name of the form.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Trained { .. } => "trained",
            Self::Sliced => "runtime",
            Self::Packed { .. } => "packed",
        }
    }

    /// Returns whether there is a codebook.
    pub(super) fn has_codebooks(self) -> bool {
        matches!(self, Self::Packed { codebooks: Some(entries) } if entries.iter().any(|&entries| entries > 0))
    }

    /// Returns the form of a scene.
    pub fn of(form: &SceneForm) -> Self {
        match form {
            SceneForm::Trained(Trained { parameters, .. }) => Self::Trained { model: parameters.model() },
            SceneForm::Ready(Form::Sliced(_)) => Self::Sliced,
            SceneForm::Ready(Form::Packed(packed)) => Self::Packed {
                codebooks: match &packed.colors {
                    PackedColors::Whole(_) => None,
                    PackedColors::Coded(colors) => {
                        let entries = |stage| colors.codebooks.entries.get(stage).copied().unwrap_or_default();
                        Some(std::array::from_fn(entries))
                    }
                },
            },
        }
    }
}

/// The temporal filter, without its sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredFilter {
    /// The method by which the sets were computed.
    pub kind: FilterKind,
    /// Number of segments of time.
    pub segments: u32,
    /// Whether the sets are stored as bits; otherwise, as intervals.
    pub bits: bool,
}

/// Names of the features that packages of this version may require.
const FEATURES: [&str; 8] =
    ["packed", "filter", "cutoff", "near", "mip_filter", "color_period", CODEBOOKS_IN_INDEX, CHUNKS_FOLLOW];

/// The feature of chunk files whose codebooks are in the index beside them.
pub(super) const CODEBOOKS_IN_INDEX: &str = "codebooks_in_index";

/// The feature of an index that the chunk files follow in one file.
pub(super) const CHUNKS_FOLLOW: &str = "chunks_follow";

/// What a package is to a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// All of it, or the index beside its chunk files.
    Whole,
    /// A chunk file, whose codebooks are left to the index.
    Chunk,
    /// The index of chunk files that follow it.
    Index,
}

/// Size of an environment map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnvironmentSize {
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
}

/// The field that is parsed before the other fields.
#[derive(Deserialize)]
struct Requirements {
    #[serde(default)]
    requires: Vec<String>,
}

impl Header {
    /// Returns the header of a scene, without sections.
    pub(super) fn of(scene: &GaussianScene, role: Role) -> Self {
        let form = StoredForm::of(&scene.form);
        let ColorDegrees { coefficients, degree, degree_t } = scene.form.color_degrees();
        let TrainedWith { marginal_cutoff, near, mip_filter, color_period, .. } = scene.trained_with;
        let is_packed = matches!(form, StoredForm::Packed { .. });
        let is_cut_elsewhere = marginal_cutoff != MARGINAL_CUTOFF;
        let repeats = color_period.is_some();
        let codebooks_in_index = role == Role::Chunk && form.has_codebooks();
        let chunks_follow = role == Role::Index;
        let used = [
            is_packed,
            scene.filter.is_some(),
            is_cut_elsewhere,
            near != NEAR,
            mip_filter,
            repeats,
            codebooks_in_index,
            chunks_follow,
        ];
        let requires = FEATURES.iter().zip(used).filter(|(_, used)| *used).map(|(name, _)| (*name).to_owned());
        Self {
            generator: concat!("bevy_gs4d ", env!("CARGO_PKG_VERSION")).to_owned(),
            requires: requires.collect(),
            form,
            gaussians: scene.len(),
            coefficients,
            degree,
            degree_t,
            environment: scene.environment.as_ref().map(|e| EnvironmentSize { width: e.width, height: e.height }),
            filter: scene.filter.as_ref().map(|filter| StoredFilter {
                kind: filter.kind,
                segments: filter.segments,
                bits: matches!(filter.sets, ActiveSets::Bits(_)),
            }),
            trained_with: scene.trained_with.clone(),
            playback: scene.playback,
            layers: match &scene.form {
                SceneForm::Ready(Form::Packed(packed)) => packed.layers.clone(),
                SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => Vec::new(),
            },
            runs: match &scene.form {
                SceneForm::Ready(Form::Packed(packed)) => packed.runs.clone(),
                SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => None,
            },
            codebooks_in_index,
            levels: scene.levels.iter().map(|level| StoredLevel { pixels: level.pixels }).collect(),
            sockets: scene.sockets.clone(),
            colliders: scene.colliders.as_deref().map(StoredColliders::of),
            sound: scene.sound.as_ref().map(|sound| sound.len()),
            chunks: scene.chunks.as_deref().cloned(),
            chunks_follow,
            sections: Vec::new(),
        }
    }

    /// Returns the RON text: one line for each field and each section.
    pub(super) fn to_text(&self) -> Result<String, PackageError> {
        let config = ron::ser::PrettyConfig::new().depth_limit(2).new_line("\n");
        ron::ser::to_string_pretty(self, config).map_err(|e| PackageError::Header(e.to_string()))
    }

    /// Parses the text. `requires` is checked first, so that a newer package is refused for the right reason.
    pub(super) fn parse(text: &[u8]) -> Result<Self, PackageError> {
        let unclear = |e: ron::error::SpannedError| PackageError::Header(e.to_string());
        let requirements: Requirements = ron::de::from_bytes(text).map_err(unclear)?;
        match requirements.requires.into_iter().find(|name| !FEATURES.contains(&name.as_str())) {
            Some(name) => Err(PackageError::UnknownFeature { name }),
            None => ron::de::from_bytes(text).map_err(unclear),
        }
    }

    /// Returns where the last section ends, in bytes, if the first starts at `start`.
    pub(super) fn end(&self, start: u64) -> u64 {
        // Each body follows its length.
        self.sections.iter().fold(start, |end, s| end.saturating_add(8).saturating_add(s.length as u64))
    }

    /// Returns the length of the file in bytes, if the first section starts at `start`: with the chunk files that
    /// follow.
    pub(super) fn length(&self, start: u64) -> u64 {
        self.files_that_follow().iter().fold(self.end(start), |end, file| end.saturating_add(file.bytes))
    }

    /// Returns the chunk files that follow the last section.
    pub(super) fn files_that_follow(&self) -> &[ChunkFile] {
        let table = self.chunks.as_ref().filter(|_| self.chunks_follow);
        table.map(|table| table.files.as_slice()).unwrap_or_default()
    }

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
            }
            if stages > 0 && !self.codebooks_in_index {
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
        if let Some([points, triangles]) = self.colliders.as_ref().map(StoredColliders::counts) {
            let table = |name, rows, width| Attribute { name, rows, stride: width, offset: 0, width };
            attributes.push(table("collider_points", points, 2));
            attributes.push(table("collider_triangles", triangles, 3));
        }
        if let Some(length) = self.sound {
            let rows = length.div_ceil(4);
            attributes.push(Attribute { name: "sound", rows, stride: 1, offset: 0, width: 1 });
        }
        attributes
    }
}
