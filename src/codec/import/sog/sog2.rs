//! SOG of PlayCanvas, versions 1 and 2: Gaussians at rest.
//!
//! In: `meta.json` and its textures. Out: a scene in the trained form, y down.

use super::files::Files;
use super::meta::{self, Images, Single, Wide};
use super::splats::{self, Layout, Rest, Table};
use super::textures;
use crate::codec::import::columns::{Columns, Played};
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;
use crate::codec::text::printable;
use crate::scene::UpAxis;
use serde::Deserialize;
use serde_json::Value;
use std::ops::Range;

/// How PlayCanvas and the writers of SOG orient captures: as 3DGS trains them.
pub(super) const UP: UpAxis = UpAxis::NegY;

/// How the splats are to be drawn; only in version 2.
#[derive(Debug, Clone, Deserialize)]
struct Drawn {
    model: Option<String>,
}

/// The attributes of version 1, which has no codebooks.
#[derive(Debug, Clone, Deserialize)]
struct First {
    means: FirstMeans,
    scales: Narrow<[f64; 3]>,
    quats: Single,
    sh0: Narrow<[f64; 4]>,
    #[serde(rename = "shN")]
    rest: Option<FirstRest>,
}

#[derive(Debug, Clone, Deserialize)]
struct FirstMeans {
    /// The number of Gaussians, first.
    shape: Vec<u64>,
    #[serde(flatten)]
    wide: Wide,
}

/// Numbers of 8 bits, linear between limits for each channel.
#[derive(Debug, Clone, Deserialize)]
struct Narrow<Limits> {
    mins: Limits,
    maxs: Limits,
    files: [String; 1],
}

/// Centroids of 8 bits, linear between limits.
#[derive(Debug, Clone, Deserialize)]
struct FirstRest {
    mins: f64,
    maxs: f64,
    files: [String; 2],
}

/// What a `meta.json` says of Gaussians at rest.
pub(super) struct Described {
    count: u64,
    layout: Layout,
    mip_filter: bool,
    /// Whether Gaussians of the code 0 have the opacity 0. In version 1 they have the least opacity, and a color.
    has_invisible: bool,
}

/// Gaussians at rest and what the scene does not show of them.
pub(super) struct Still {
    pub columns: Columns,
    pub lost: Vec<String>,
}

/// Reads a scene.
///
/// # Errors
/// As [`Described::of`] and [`Described::still`]; invalid options.
pub(super) fn read(files: &mut Files, meta: &Value, options: &ReadOptions) -> Result<Imported, ImportError> {
    let Still { columns, lost } = Described::of(meta)?.still(files, None)?;
    Ok(Imported { scene: columns.into_scene(Played::still(UP), options)?, lost })
}

impl Described {
    /// Returns what a `meta.json` says.
    ///
    /// # Errors
    /// Another version, a model that is not drawn; a field that is missing or wrong.
    pub(super) fn of(meta: &Value) -> Result<Self, ImportError> {
        let meta::Kind { version, .. } = meta::part("meta.json", meta)?;
        let (count, layout) = match version {
            None => first(meta)?,
            Some(2) => {
                let images: Images = meta::part("meta.json", meta)?;
                (images.count, Layout::of_images(images)?)
            }
            Some(version) => {
                return Err(ImportError::unsupported(format!(
                    "a SOG of version {version}, and only versions 1 and 2 are known; convert it to PLY with the current splat-transform"
                )));
            }
        };
        let Drawn { model } = meta::part("meta.json", meta)?;
        let mip_filter = match model.as_deref() {
            None => false,
            Some("antialiased") => true,
            Some(model) => {
                let model = printable(model);
                return Err(ImportError::unsupported(format!(
                    "a SOG of the model \"{model}\", whose splats are not 3D Gaussians"
                )));
            }
        };
        Ok(Self { count, layout, mip_filter, has_invisible: version.is_some() })
    }

    /// Returns the names of all its textures.
    pub(super) fn textures(&self) -> impl Iterator<Item = &str> {
        let centroids = self.layout.rest.as_ref().map(|rest| rest.centroids.as_str());
        self.layout.names().chain(centroids)
    }

    /// Reads its Gaussians: those in the ranges given, or all.
    ///
    /// # Errors
    /// A file that is missing or damaged; a range beyond the end.
    pub(super) fn still(&self, files: &mut Files, ranges: Option<&[Range<usize>]>) -> Result<Still, ImportError> {
        let Self { count, layout, mip_filter, has_invisible } = self;
        let centroids = layout.centroids(files)?;
        let encoded = textures::read(files, layout.names())?;
        let count = textures::check_count(*count, &encoded)?;
        let textures = textures::decode(&encoded, count)?;
        let whole = 0..count;
        let ranges = ranges.unwrap_or(std::slice::from_ref(&whole));
        let wanted: usize = ranges.iter().map(Range::len).sum();
        if wanted > count || ranges.iter().any(|range| range.end > count) {
            return Err(ImportError::damaged(format!("it has {count} Gaussians, fewer than lod-meta.json states")));
        }
        let kept: Vec<u32> = if *has_invisible {
            ranges.iter().flat_map(|range| splats::visible(&textures, range.clone())).collect()
        } else {
            ranges.iter().flat_map(|range| range.start as u32..range.end as u32).collect()
        };
        let lost = invisible(wanted - kept.len(), wanted).into_iter().collect();
        let columns = layout.columns(&textures, &centroids, &kept)?;
        Ok(Still { columns: Columns { mip_filter: *mip_filter, ..columns }, lost })
    }
}

/// Returns the sentence about Gaussians of opacity 0, if there are any.
pub(super) fn invisible(dropped: usize, all: usize) -> Option<String> {
    (dropped > 0).then(|| format!("{dropped} of {all} Gaussians have the opacity 0 and are left out."))
}

/// Returns the number of Gaussians and the layout of version 1.
fn first(meta: &Value) -> Result<(u64, Layout), ImportError> {
    let First { means, scales, quats, sh0, rest } = meta::part("meta.json", meta)?;
    let FirstMeans { shape, wide: means } = means;
    let count =
        *shape.first().ok_or_else(|| ImportError::damaged("its meta.json does not state how many means it has"))?;
    let table = |least: f64, most: f64| {
        let is_finite = [least, most].iter().all(|&limit| (limit as f32).is_finite());
        let table = is_finite.then(|| Table::between(least, most));
        table.ok_or_else(|| ImportError::damaged("its meta.json has a limit that is too large"))
    };
    let [x, y, z] = [0, 1, 2].map(|axis| table(scales.mins[axis], scales.maxs[axis]));
    let [red, green, blue, opacity] = [0, 1, 2, 3].map(|channel| table(sh0.mins[channel], sh0.maxs[channel]));
    let rest = rest.map(|FirstRest { mins, maxs, files: [centroids, labels] }| {
        Ok::<_, ImportError>(Rest { centroids, labels, stated: None, values: table(mins, maxs)? })
    });
    let ([scales], [rotations], [colors]) = (scales.files, quats.files, sh0.files);
    let (scale, color) = ([x?, y?, z?], [red?, green?, blue?]);
    // Its opacities are logits.
    let (opacity, rest) = (opacity?, rest.transpose()?);
    Ok((count, Layout { means, scales, scale, rotations, colors, color, opacity, rest }))
}
