//! The header: the contents of a package and their location.
//!
//! In: a scene, or the RON text of a file. Out: a [`Header`] whose numbers have been checked against each other and
//! against the length of the file, so that the code that follows can rely on them.

use super::layout::Attribute;
use super::{PACKAGE, PackageError, Section};
use crate::gaussian::Model;
use crate::gaussian::harmonics::{MAX_COEFFICIENTS, evaluated};
use crate::scene::detail::check_sizes;
use crate::scene::packed::{MAX_ENTRIES, MAX_STAGES};
use crate::scene::{
    ActiveSets, ColorDegrees, FilterKind, Form, GaussianScene, MAX_LEVELS, MAX_SEGMENTS, PackedColors, PlaybackHints,
    SceneForm, Trained, TrainedWith,
};
use serde::{Deserialize, Serialize};

/// Uncompressed bytes that a package of any length may hold.
const RAW_FLOOR: u64 = 64 << 20;

/// Further uncompressed bytes allowed for each byte of the file. Trained captures need 1.2.
const RAW_PER_BYTE: u64 = 256;

/// Most sections that are read. The writer makes fewer of a hundred million Gaussians.
const MAX_SECTIONS: usize = 1 << 16;

/// The header of a package. Fields that a reader does not know are ignored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The program that wrote the package, for people.
    #[serde(default)]
    pub generator: String,
    /// Features that a reader must know to read the package correctly. A reader refuses those it does not know.
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
    /// The switches the capture was trained with.
    pub trained_with: TrainedWith,
    /// How the capture is meant to be played.
    pub playback: PlaybackHints,
    /// The levels of detail, finest first. Each is a section `level` of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<StoredLevel>,
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
        /// Entries of each codebook of color; `None` if the coefficients are whole.
        codebooks: Option<[u32; MAX_STAGES]>,
    },
}

impl StoredForm {
    /// Returns the form of a scene.
    pub fn of(form: &SceneForm) -> Self {
        match form {
            SceneForm::Trained(Trained { parameters, .. }) => Self::Trained { model: parameters.model() },
            SceneForm::Ready(Form::Sliced(_)) => Self::Sliced,
            SceneForm::Ready(Form::Packed(packed)) => Self::Packed {
                codebooks: match &packed.colors {
                    PackedColors::Whole(_) => None,
                    PackedColors::Coded(colors) => {
                        let entries = |stage| colors.entries.get(stage).copied().unwrap_or_default();
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
    /// How the sets were computed.
    pub kind: FilterKind,
    /// Number of segments of time.
    pub segments: u32,
    /// Whether the sets are stored as bits; otherwise, as intervals.
    pub bits: bool,
}

/// Names of the features that packages of this version may require.
const FEATURES: [&str; 2] = ["packed", "filter"];

/// Size of an environment map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnvironmentSize {
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
}

/// The field that is parsed before all others.
#[derive(Deserialize)]
struct Requirements {
    #[serde(default)]
    requires: Vec<String>,
}

impl Header {
    /// Returns the header of a scene, without sections.
    pub(super) fn of(scene: &GaussianScene) -> Result<Self, PackageError> {
        let form = StoredForm::of(&scene.form);
        let ColorDegrees { coefficients, degree, degree_t } = scene.form.color_degrees();
        let used = [matches!(form, StoredForm::Packed { .. }), scene.filter.is_some()];
        let requires = FEATURES.iter().zip(used).filter(|(_, used)| *used).map(|(name, _)| (*name).to_owned());
        let header = Self {
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
            levels: scene.levels.iter().map(|level| StoredLevel { pixels: level.pixels }).collect(),
            sections: Vec::new(),
        };
        header.check_numbers()?;
        header.check_scene(scene)?;
        scene.check().map_err(PackageError::Inconsistent)?;
        Ok(header)
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

    /// Checks that the sections, from `start` on, fill a file of `file_length` bytes and hold every attribute once, and
    /// that all numbers are valid. Afterwards the sizes of [`attributes`](Self::attributes) can be allocated.
    pub(super) fn check(&self, start: u64, file_length: u64) -> Result<(), PackageError> {
        let expected = self.end(start);
        if expected > file_length {
            return Err(PackageError::Truncated { expected, found: file_length });
        }
        if expected < file_length {
            return Err(PackageError::TrailingBytes { count: file_length - expected });
        }
        let found = self.sections.len();
        if found > MAX_SECTIONS {
            return Err(PackageError::TooManySections { found, limit: MAX_SECTIONS });
        }
        self.check_numbers()?;
        let attributes = self.attributes();
        let limit = unpacked_limit(file_length);
        let within = |raw: u64| if raw > limit { Err(PackageError::TooLarge { raw, limit }) } else { Ok(()) };
        within(scene_memory(&attributes))?;
        attributes.iter().try_for_each(|attribute| attribute.check_sections(&self.sections))?;
        within(self.unpacked())?;
        self.check_level_sections()
    }

    /// Returns the bytes that reading takes, without levels of detail. The sections must have been checked.
    pub(super) fn unpacked(&self) -> u64 {
        let attributes = self.attributes();
        // Beside the scene, one section at a time is decompressed.
        let decoded = self.sections.iter().filter(|s| attributes.iter().any(|attribute| attribute.name == s.name));
        let largest = decoded.map(|section| section.raw_length as u64).max().unwrap_or_default();
        scene_memory(&attributes).saturating_add(largest)
    }

    /// Checks that each level of detail has its section, in order.
    fn check_level_sections(&self) -> Result<(), PackageError> {
        let mut next = 0;
        for section in self.sections.iter().filter(|section| section.name == LEVEL) {
            let name = section.name.clone();
            if section.encoding != PACKAGE {
                return Err(PackageError::UnknownEncoding { name, encoding: section.encoding.clone() });
            }
            if section.first != next || section.count != 1 || next == self.levels.len() {
                let (found, count) = (section.first, section.count);
                return Err(PackageError::SectionRange { name, found, count, expected: next });
            }
            if section.raw_length != section.length {
                let (expected, found) = (section.length as u64, section.raw_length as u64);
                return Err(PackageError::SectionLength { name, expected, found });
            }
            next += 1;
        }
        match next < self.levels.len() {
            true => Err(PackageError::MissingSection { name: LEVEL.to_owned() }),
            false => Ok(()),
        }
    }

    /// Checks the numbers, without the sections.
    fn check_numbers(&self) -> Result<(), PackageError> {
        let trained = &self.trained_with;
        let [first, last] = trained.time_interval;
        let sane = |condition: bool, otherwise: &'static str| {
            if condition { Ok(()) } else { Err(PackageError::Inconsistent(otherwise)) }
        };
        self.check_color()?;
        sane(
            self.environment.is_none_or(|e| e.width.checked_mul(e.height).is_some_and(|texels| texels > 0)),
            "an environment map with no texels, or far too many",
        )?;
        sane(
            first.is_finite() && first < last && (last - first).is_finite(),
            "the time interval must be two finite numbers, the first below the second, and not infinitely far apart",
        )?;
        sane(trained.background.iter().all(|c| c.is_finite()), "a background colour that is not finite")?;
        sane(
            trained.prefilter_var.is_finite() && trained.spatial_lr_scale.is_finite(),
            "a switch of training (prefilter_var or spatial_lr_scale) that is not finite",
        )?;
        sane(
            trained.pixel.is_none_or(|pixel| pixel.is_finite() && pixel > 0.0),
            "a size of the training views' pixels that is not positive and finite",
        )?;
        sane(trained.spatial_lr_scale >= 0.0, "a switch of training (spatial_lr_scale) that is negative")?;
        sane(
            self.filter.is_none_or(|filter| (1..=MAX_SEGMENTS).contains(&filter.segments)),
            "a temporal filter of no segments, or far too many",
        )?;
        sane(self.levels.len() <= MAX_LEVELS, "more levels of detail than a capture may have")?;
        check_sizes(self.levels.iter().map(|level| level.pixels)).map_err(PackageError::Inconsistent)?;
        let duration = self.playback.duration_seconds;
        sane(duration.is_finite() && duration >= 0.0, "the playback duration must be a finite number, zero or above")
    }

    /// Checks the numbers of color: degrees that exist, and as many coefficients as they need. In codebooks there are
    /// no others.
    fn check_color(&self) -> Result<(), PackageError> {
        let (found, degree, degree_t) = (self.coefficients, self.degree, self.degree_t);
        if degree > 3 || degree_t > 2 || found > MAX_COEFFICIENTS {
            return Err(PackageError::Inconsistent(
                "colour must have a degree of 0 to 3, a time degree of 0 to 2 and at most 48 coefficients",
            ));
        }
        let needed = evaluated(degree, degree_t);
        let refused = |section| Err(PackageError::Coefficients { section, found, needed, degree, degree_t });
        match self.form {
            StoredForm::Packed { codebooks: Some(entries) } => {
                if entries.iter().any(|&entries| entries > MAX_ENTRIES) {
                    return Err(PackageError::Inconsistent("section `codebooks` has more entries than 16-bit codes"));
                }
                if found == needed { Ok(()) } else { refused("codebooks") }
            }
            StoredForm::Trained { .. } | StoredForm::Sliced | StoredForm::Packed { codebooks: None } => {
                if found >= needed { Ok(()) } else { refused(if found == 0 { "sh_dc" } else { "sh_rest" }) }
            }
        }
    }
}

/// Returns the bytes that a package of this length may take when it is read.
pub(super) fn unpacked_limit(file_length: u64) -> u64 {
    RAW_PER_BYTE.saturating_mul(file_length).saturating_add(RAW_FLOOR).min(isize::MAX as u64)
}

/// Returns the bytes of the tables of all attributes.
fn scene_memory(attributes: &[Attribute]) -> u64 {
    attributes.iter().fold(0u64, |sum, attribute| sum.saturating_add(attribute.memory()))
}
