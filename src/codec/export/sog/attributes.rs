//! The attributes that all formats of the SOG family have, from columns to textures.
//!
//! In: [`Columns`], and their means as they are stored. Out: [`Attributes`]: codes of each Gaussian, and the
//! description of their meaning for `meta.json`.

use super::archive::Entry;
use super::codebook::Codebook;
use super::palette::Palette;
use super::wide::Wide;
use super::{rotation, texture};
use crate::codec::import::columns::Columns;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::io;

/// Centroids in a row of their texture.
const IN_A_ROW: usize = 64;
/// The name of the texture of centroids.
const CENTROIDS: &str = "shN_centroids.webp";
/// The name of the textures of labels.
const LABELS: &str = "shN_labels.webp";

/// The texels of a texture, by the index of the Gaussian.
pub(super) type Texels<'a> = Box<dyn Fn(usize) -> [u8; 4] + Sync + 'a>;

/// Codes of Gaussians at rest.
pub(super) struct Attributes<'a> {
    columns: &'a Columns,
    means: Wide,
    scales: Codebook,
    colors: Codebook,
    rest: Option<Rest>,
}

/// Coefficients of degree 1 and above.
struct Rest {
    degree: u32,
    palette: Palette,
    values: Codebook,
}

impl<'a> Attributes<'a> {
    /// Codes Gaussians; `means` replace those of the columns.
    pub(super) fn of(columns: &'a Columns, means: &[[f64; 3]]) -> Self {
        let harmonics = &columns.harmonics;
        let stride = harmonics.coefficients * 3;
        let color = |index: usize| harmonics.values[index * stride..][..3].to_vec();
        let rest = (harmonics.degree > 0).then(|| {
            let width = coefficients(harmonics.degree) * 3;
            let values: Vec<f32> =
                harmonics.values.par_chunks_exact(stride).flat_map_iter(|own| own[3..3 + width].to_vec()).collect();
            let palette = Palette::of(&values, width);
            let values = Codebook::of(palette.rows.clone());
            Rest { degree: harmonics.degree, palette, values }
        });
        Self {
            columns,
            means: Wide::of(means),
            scales: Codebook::of(columns.log_scale.par_iter().flat_map_iter(|scales| *scales)),
            colors: Codebook::of((0..columns.len()).into_par_iter().flat_map_iter(color)),
            rest,
        }
    }

    /// Returns the Morton code of each Gaussian: in its order, neighbors in space are together.
    pub(super) fn places(&self) -> Vec<u64> {
        let spread = |code: u16| (0..16).fold(0, |sum, bit| sum | u64::from(code >> bit & 1) << (3 * bit));
        self.means.codes.par_iter().map(|&[x, y, z]| spread(x) | spread(y) << 1 | spread(z) << 2).collect()
    }

    /// Returns the textures with a texel for each Gaussian, without labels.
    pub(super) fn textures(&self) -> Vec<(&'static str, Texels<'_>)> {
        let columns = self.columns;
        let stride = columns.harmonics.coefficients * 3;
        let scales = move |index: usize| {
            let [x, y, z] = columns.log_scale[index].map(|scale| self.scales.code(scale));
            [x, y, z, u8::MAX]
        };
        let colors = move |index: usize| {
            let color = &columns.harmonics.values[index * stride..];
            let opacity = 1.0 / (1.0 + (-f64::from(columns.opacity_logit[index])).exp());
            let [red, green, blue] = [0, 1, 2].map(|channel| self.colors.code(color[channel]));
            [red, green, blue, (255.0 * opacity).round() as u8]
        };
        vec![
            ("means_l.webp", Box::new(|index| self.means.low(index))),
            ("means_u.webp", Box::new(|index| self.means.high(index))),
            ("quats.webp", Box::new(|index| rotation::texel(columns.rotation[index]))),
            ("scales.webp", Box::new(scales)),
            ("sh0.webp", Box::new(colors)),
        ]
    }

    /// Returns the texture of labels, if there are any.
    pub(super) fn labels(&self) -> Option<(&'static str, Texels<'_>)> {
        let labels = &self.rest.as_ref()?.palette.labels;
        let texel = |index: usize| {
            let [low, high] = labels[index].to_le_bytes();
            [low, high, 0, u8::MAX]
        };
        Some((LABELS, Box::new(texel)))
    }

    /// Returns the texture of centroids, if there are any.
    ///
    /// # Errors
    /// As [`texture::encode_sized`].
    pub(super) fn centroids(&self) -> io::Result<Option<Entry>> {
        let Some(Rest { degree, palette, values }) = &self.rest else { return Ok(None) };
        let texels: Vec<[u8; 4]> = palette
            .rows
            .par_chunks_exact(3)
            .map(|color| [values.code(color[0]), values.code(color[1]), values.code(color[2]), u8::MAX])
            .collect();
        let width = IN_A_ROW * coefficients(*degree);
        let bytes = texture::encode_sized(&texels, width, texels.len().div_ceil(width).max(1))?;
        Ok(Some(Entry { name: CENTROIDS.to_owned(), bytes }))
    }

    /// Adds the description of the attributes to `meta.json`.
    pub(super) fn describe(&self, meta: &mut Value) {
        meta["count"] = json!(self.columns.len());
        meta["asset"] = json!({ "generator": concat!("bevy_gs4d ", env!("CARGO_PKG_VERSION")) });
        meta["means"] = self.means.described(["means_l.webp", "means_u.webp"]);
        meta["scales"] = json!({ "codebook": self.scales.entries(), "files": ["scales.webp"] });
        meta["quats"] = json!({ "files": ["quats.webp"] });
        meta["sh0"] = json!({ "codebook": self.colors.entries(), "files": ["sh0.webp"] });
        if let Some(Rest { degree, palette, values }) = &self.rest {
            let count = palette.rows.len() / (3 * coefficients(*degree));
            let files = [CENTROIDS, LABELS];
            meta["shN"] = json!({ "count": count, "bands": degree, "codebook": values.entries(), "files": files });
        }
    }
}

/// Encodes the textures of the Gaussians of a group, in their order; `folder` is empty or has a slash at its end.
///
/// # Errors
/// More Gaussians than a picture has pixels.
pub(super) fn encode(folder: &str, order: &[u32], textures: &[(&'static str, Texels<'_>)]) -> io::Result<Vec<Entry>> {
    let encode = |(name, texel): &(&'static str, Texels<'_>)| {
        let texels: Vec<[u8; 4]> = order.iter().map(|&index| texel(index as usize)).collect();
        Ok(Entry { name: format!("{folder}{name}"), bytes: texture::encode(&texels)? })
    };
    textures.par_iter().map(encode).collect()
}

/// Returns the number of coefficients of degree 1 and above.
fn coefficients(degree: u32) -> usize {
    (degree as usize + 1).pow(2) - 1
}
