//! What a bake did and what it cost, for people and for programs.
//!
//! In: facts gathered by the stages of a bake. Out: a [`BakeReport`], as JSON and as one HTML page that needs nothing else.

mod html;
mod plot;
mod temporal;

pub use plot::{Axis, Chart, Series, bars};
pub use temporal::{Activity, VarianceHistogram, even_times, filter_shares};

use super::metrics::Evaluation;
use crate::codec::package::Section;
use crate::view::Picture;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Everything a bake has to say.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BakeReport {
    /// What made it: name and version.
    pub generator: String,
    /// The checkpoint.
    pub checkpoint: String,
    /// The folder of the training views.
    pub data: String,
    /// The package.
    pub package: String,
    /// Number of Gaussians.
    pub gaussians: Change<usize>,
    /// Bytes of the checkpoint and of the package.
    pub bytes: Change<u64>,
    /// What was chosen, by the user or by the bake, in words: name and value.
    pub choices: Vec<(String, String)>,
    /// What each stage took.
    pub stages: Vec<StageTime>,
    /// Bytes of the package by section.
    pub sections: Vec<SectionSize>,
    /// How the temporal variances are distributed.
    pub variances: VarianceHistogram,
    /// The times of `activity` and `filter_share`.
    pub times: Vec<f32>,
    /// Which Gaussians are active when.
    pub activity: Change<Activity>,
    /// Share of the kept Gaussians that the filter lets through, at each time.
    pub filter_share: Option<Vec<f64>>,
    /// The counts that were tried on held-out training views.
    pub trials: Vec<Tried>,
    /// The split that the evaluation is about; `None` where its images are not there.
    pub split: Option<String>,
    /// The test views, drawn from the checkpoint and from the package.
    pub evaluation: Option<Change<Evaluation>>,
    /// A few of those views.
    #[serde(skip)]
    pub samples: Vec<Sample>,
}

/// The same before and after the bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Change<T> {
    /// Of the checkpoint.
    pub before: T,
    /// Of the package.
    pub after: T,
}

/// What a stage took.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageTime {
    /// Its name.
    pub name: String,
    /// Seconds.
    pub seconds: f64,
    /// Whether the result of an earlier bake was taken.
    pub skipped: bool,
}

/// All sections of one name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SectionSize {
    /// Their name.
    pub name: String,
    /// Bytes in the file.
    pub bytes: u64,
    /// Bytes when unpacked.
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

/// One view as it was seen and as it is drawn before and after.
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
    /// Adds up sections of the same name, largest first.
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
    /// The JSON document, without the samples.
    ///
    /// # Errors
    /// None that numbers and names could cause: what is infinite or NaN becomes null.
    pub fn json(&self) -> Result<Value, serde_json::Error> {
        serde_json::to_value(self)
    }

    /// The HTML page.
    pub fn html(&self) -> String {
        html::page(self)
    }
}
