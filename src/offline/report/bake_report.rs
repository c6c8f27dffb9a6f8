//! The contents of the report of a bake.
//!
//! In: the results of the stages. Out: a [`BakeReport`], as JSON.

use super::temporal::{Activity, VarianceHistogram};
use crate::codec::package::Section;
use crate::offline::measure::Evaluation;
use crate::offline::store::stages::StageTime;
use crate::offline::train::CurvePoint;
use crate::view::Picture;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The report of a bake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BakeReport {
    /// Name and version of the program that wrote it.
    pub generator: String,
    /// Path of the checkpoint.
    pub checkpoint: String,
    /// Path of the folder of the training views.
    pub data: String,
    /// Path of the package.
    pub package: String,
    /// Number of Gaussians.
    pub gaussians: Change<usize>,
    /// Bytes of the checkpoint and of the package.
    pub bytes: Change<u64>,
    /// The choices of the user and of the bake, as names and values.
    pub choices: Vec<(String, String)>,
    /// A sentence for each promise of the quality that the package does not keep.
    pub warnings: Vec<String>,
    /// Durations of the stages, in order; the stage that writes the report is not among them.
    pub stages: Vec<StageTime>,
    /// Bytes of the package by section.
    pub sections: Vec<SectionSize>,
    /// Distribution of the temporal variances.
    pub variances: VarianceHistogram,
    /// The times of `activity` and `filter_share`.
    pub times: Vec<f32>,
    /// Active Gaussians over time.
    pub activity: Change<Activity>,
    /// Share of the kept Gaussians that the filter leaves active, at each time; `None` without a filter.
    pub filter_share: Option<Vec<f64>>,
    /// The counts that were tried on held-out training views.
    pub trials: Vec<Tried>,
    /// The quality during fine-tuning, on training views; empty without it.
    pub fine_tuning: Vec<CurvePoint>,
    /// Name of the evaluated split; `None` if its images are missing.
    pub split: Option<String>,
    /// Metrics over the views of that split, drawn from the checkpoint and from the package; `None` if their images are
    /// missing.
    pub evaluation: Option<Change<Evaluation>>,
    /// A few of those views with their pictures. Not part of the JSON.
    #[serde(skip)]
    pub samples: Vec<Sample>,
}

/// A value before and after the bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change<T> {
    /// Of the checkpoint.
    pub before: T,
    /// Of the package.
    pub after: T,
}

/// The size of all sections of one name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SectionSize {
    /// Their name.
    pub name: String,
    /// Bytes in the file.
    pub bytes: u64,
    /// Bytes before compression.
    pub unpacked: u64,
}

/// A count of Gaussians that was tried on held-out training views.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// The score that chose the Gaussians.
    pub variant: String,
    /// Share removed.
    pub ratio: f64,
    /// Number kept.
    pub kept: usize,
    /// PSNR in dB over the held-out views.
    pub psnr: f64,
}

/// One view: its image, and its pictures before and after the bake.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Name of the view, with its time.
    pub name: String,
    /// The image of the dataset.
    pub reference: Picture,
    /// Drawn from the checkpoint.
    pub before: Picture,
    /// Drawn from the package.
    pub after: Picture,
}

impl SectionSize {
    /// Returns the sizes of sections, added up by name, largest first.
    pub fn by_name(sections: &[Section]) -> Vec<Self> {
        let mut sizes: Vec<Self> = Vec::new();
        for section in sections {
            let (bytes, unpacked) = (section.length as u64, section.raw_length as u64);
            match sizes.iter_mut().find(|size| size.name == section.name) {
                Some(size) => (size.bytes, size.unpacked) = (size.bytes + bytes, size.unpacked + unpacked),
                None => sizes.push(Self { name: section.name.clone(), bytes, unpacked }),
            }
        }
        sizes.sort_by_key(|size| std::cmp::Reverse(size.bytes));
        sizes
    }
}

impl BakeReport {
    /// Returns the JSON document, without the samples. Numbers that are infinite or NaN become null.
    ///
    /// # Errors
    /// Those of `serde_json`; the contents of a report cause none.
    pub fn json(&self) -> Result<Value, serde_json::Error> {
        serde_json::to_value(self)
    }
}
