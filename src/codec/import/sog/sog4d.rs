//! `.sog4d` of SuperSplat's 4D branch, version 1: SOG with linear motion and radial basis functions of time.
//!
//! In: `meta.json` and its textures. Out: a moving scene, y down, in absolute seconds. Segments, an index, are not
//! read.

use super::files::Files;
use super::meta::{self, Images, Wide};
use super::sog2::{UP, invisible};
use super::splats::{self, Layout, Table, check_codes};
use super::textures::{self, Texture};
use crate::codec::import::columns::{Motion, Played};
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;
use crate::codec::text::printable;
use crate::gaussian::SMALLEST_CUTOFF;
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;

/// The fields beside those of SOG.
#[derive(Debug, Clone, Deserialize)]
struct Fields {
    start: f64,
    duration: f64,
    motion: Wide,
    trbf: Lifespans,
    cubemap: Option<Value>,
}

/// Temporal means, and logarithms of the temporal scales.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "encoding")]
enum Lifespans {
    #[serde(rename = "kmeans")]
    Codebooks { center_codebook: Vec<Option<f64>>, scale_codebook: Vec<Option<f64>>, files: [String; 1] },
    #[serde(rename = "quantize16")]
    Wide { center_min: f64, center_max: f64, scale_min: f64, scale_max: f64, files: [String; 2] },
}

/// Reads a scene.
///
/// # Errors
/// Another version; a file that is missing or damaged; invalid options.
pub(super) fn read(files: &mut Files, meta: &Value, options: &ReadOptions) -> Result<Imported, ImportError> {
    let meta::Kind { version, .. } = meta::part("meta.json", meta)?;
    if version != Some(1) {
        let version = version.map_or("no version".to_owned(), |version| format!("version {version}"));
        return Err(ImportError::unsupported(format!("a .sog4d of {version}, and only version 1 is known")));
    }
    let images: Images = meta::part("meta.json", meta)?;
    let count = images.count;
    let layout = Layout::of_images(images)?;
    let Fields { start, duration, motion, trbf, cubemap } = meta::part("meta.json", meta)?;
    let mut names: Vec<&str> = layout.names().collect();
    let common = names.len();
    names.extend(motion.files.iter().map(String::as_str));
    names.extend(trbf.files().iter().map(String::as_str));
    let centroids = layout.centroids(files)?;
    let encoded = textures::read(files, names)?;
    let count = textures::check_count(count, &encoded)?;
    let decoded = textures::decode(&encoded, count)?;
    let (attributes, others) = decoded.split_at(common);
    let [low, high, times @ ..] = others else {
        return Err(ImportError::damaged("its textures of motion are missing"));
    };
    let kept = splats::visible(attributes, 0..count);
    let mut columns = layout.columns(attributes, &centroids, &kept)?;
    let lifespans = trbf.of(times, &kept)?;
    columns.motion = kept
        .par_iter()
        .zip(lifespans)
        .map(|(&i, [mean_t, log_scale])| {
            let velocity = motion.signed_log(low.at(i), high.at(i));
            // Its envelope is exp(−(dt / s)²).
            let sigma_t = (f64::from(log_scale).exp() * std::f64::consts::FRAC_1_SQRT_2) as f32;
            Motion { velocity, mean_t, sigma_t }
        })
        .collect();
    let played = Played {
        up: UP,
        time_interval: [start as f32, (start + duration) as f32],
        duration_seconds: duration as f32,
        marginal_cutoff: SMALLEST_CUTOFF,
    };
    if !(duration > 0.0
        && played.time_interval.iter().all(|time| time.is_finite())
        && played.time_interval[0] < played.time_interval[1])
    {
        return Err(ImportError::damaged(format!("its meta.json has a duration of {duration} seconds from {start}")));
    }
    let mut lost: Vec<String> = invisible(count - kept.len(), count).into_iter().collect();
    if cubemap.is_some_and(|cubemap| !cubemap.is_null()) {
        lost.push("Its cube map, the background, is not shown.".to_owned());
    }
    Ok(Imported { scene: columns.into_scene(played, options)?, lost })
}

/// Returns the error about a file with several captures in it.
pub(super) fn several() -> ImportError {
    ImportError::unsupported(
        "a .sog4d of several captures (sog4d_multi); unpack it, and read the meta.json in its folder dynamic and in each folder static_1, ..",
    )
}

/// Returns the error about an unknown type.
pub(super) fn unknown(name: &str) -> ImportError {
    ImportError::unsupported(format!("a capture of the type \"{}\", which is not known", printable(name)))
}

impl Lifespans {
    fn files(&self) -> &[String] {
        match self {
            Self::Codebooks { files, .. } => files,
            Self::Wide { files, .. } => files,
        }
    }

    /// Returns the temporal mean and the logarithm of the temporal scale of each Gaussian.
    fn of(&self, textures: &[Texture], kept: &[u32]) -> Result<Vec<[f32; 2]>, ImportError> {
        match (self, textures) {
            (Self::Codebooks { center_codebook, scale_codebook, .. }, [codes]) => {
                let mean = Table::of_codebook("trbf centers", center_codebook)?;
                let scale = Table::of_codebook("trbf scales", scale_codebook)?;
                let lifespan = |&i: &u32| [mean.at(codes.at(i)[0]), scale.at(codes.at(i)[1])];
                let lifespans: Vec<[f32; 2]> = kept.par_iter().map(lifespan).collect();
                check_codes("trbf", lifespans.as_flattened())?;
                Ok(lifespans)
            }
            (&Self::Wide { center_min, center_max, scale_min, scale_max, .. }, [low, high]) => {
                let (mins, maxs) = ([center_min, scale_min, 0.0], [center_max, scale_max, 0.0]);
                let wide = Wide { mins, maxs, files: Default::default() };
                let lifespan = |&i: &u32| {
                    let [mean, scale, _] = wide.linear(low.at(i), high.at(i));
                    [mean as f32, scale as f32]
                };
                Ok(kept.par_iter().map(lifespan).collect())
            }
            _ => Err(ImportError::damaged("its textures of lifespans are missing")),
        }
    }
}
