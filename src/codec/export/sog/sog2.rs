//! `.sog` of PlayCanvas, version 2: Gaussians at rest.
//!
//! In: [`Columns`]. Out: a zip archive of `meta.json` and textures.

use super::archive::{self, Entry};
use super::attributes::{Attributes, encode};
use crate::codec::export::clip::Clip;
use crate::codec::export::y_up::y_down;
use crate::codec::import::columns::Columns;
use serde_json::json;
use std::io::{self, Write};

/// Writes Gaussians at rest.
///
/// # Errors
/// Errors of the writer; more Gaussians than a picture has pixels.
pub(in crate::codec::export) fn write(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let columns = &*y_down(columns, clip.up)?;
    let means: Vec<[f64; 3]> = columns.mean.iter().map(|mean| mean.map(f64::from)).collect();
    let attributes = Attributes::of(columns, &means);
    let places = attributes.places();
    let mut order: Vec<u32> = (0..columns.len() as u32).collect();
    order.sort_unstable_by_key(|&index| (places[index as usize], index));
    let mut textures = attributes.textures();
    textures.extend(attributes.labels());
    let mut meta = json!({ "version": 2 });
    if columns.mip_filter {
        meta["model"] = json!("antialiased");
    }
    attributes.describe(&mut meta);
    let meta = Entry { name: "meta.json".to_owned(), bytes: serde_json::to_vec(&meta)? };
    let textures = encode("", &order, &textures)?;
    archive::write([&meta].into_iter().chain(&textures).chain(&attributes.centroids()?), writer)
}
