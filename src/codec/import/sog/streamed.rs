//! Streamed SOG: levels of detail, each of several SOG folders.
//!
//! In: `lod-meta.json` and the folders beside it. Out: a scene of the finest level whose folders are all there, y down.

use super::files::Files;
use super::meta;
use super::sog2::{self, Still, UP};
use crate::codec::import::columns::{Columns, Played, mip_filter_of};
use crate::codec::import::source::Beside;
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;
use crate::codec::text::printable;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io;
use std::ops::Range;

/// Largest number of levels: more than any writer makes.
const MOST_LEVELS: u64 = 64;

/// The fields of the file.
#[derive(Debug, Clone, Deserialize)]
struct Fields {
    version: Option<u64>,
    #[serde(rename = "lodLevels")]
    levels: u64,
    filenames: Vec<String>,
    environment: Option<String>,
    tree: Node,
}

/// A part of space: with parts of its own, or with its Gaussians in several levels.
#[derive(Debug, Clone, Deserialize)]
struct Node {
    #[serde(default)]
    children: Vec<Node>,
    /// By the number of the level.
    #[serde(default)]
    lods: BTreeMap<String, Chunk>,
}

/// Gaussians of a part of space: a range of a file.
#[derive(Debug, Clone, Copy, Deserialize)]
struct Chunk {
    file: usize,
    offset: usize,
    count: usize,
}

/// Reads a scene.
///
/// # Errors
/// Another version; no level with all its folders; a file that is damaged; invalid options.
pub(super) fn read(beside: &dyn Beside, meta: &Value, options: &ReadOptions) -> Result<Imported, ImportError> {
    let fields: Fields = meta::part("lod-meta.json", meta)?;
    if let Some(version) = fields.version.filter(|&version| version != 1) {
        return Err(ImportError::unsupported(format!(
            "a streamed SOG of version {version}, and only version 1 is known"
        )));
    }
    let mut missing = Vec::new();
    for level in 0..fields.levels.min(MOST_LEVELS) {
        let files = fields.files_of(level)?;
        match level_of(beside, &files) {
            Ok(Level { mut columns, mut filtered, mut lost }) => {
                if !missing.is_empty() {
                    lost.push(format!(
                        "This is level {level} of its levels of detail, with {} Gaussians: files of the finer levels are missing ({}).",
                        columns.len(),
                        missing.join("; ")
                    ));
                }
                let mut parts = files.len();
                if let Some(name) = &fields.environment {
                    match still(beside, name, None) {
                        Ok(around) => {
                            parts += 1;
                            filtered += usize::from(around.columns.mip_filter);
                            columns.append(around.columns);
                        }
                        Err(error) => lost.push(format!("Its surroundings are not shown: {error}.")),
                    }
                }
                let (mip_filter, mixed) = mip_filter_of(filtered, parts, "files");
                columns.mip_filter = mip_filter;
                lost.extend(mixed);
                return Ok(Imported { scene: columns.into_scene(Played::still(UP), options)?, lost });
            }
            Err(ImportError::Io(error)) if error.kind() == io::ErrorKind::NotFound => missing.push(error.to_string()),
            Err(error) => return Err(error),
        }
    }
    Err(ImportError::damaged(format!(
        "none of its levels of detail has all of its files ({}); copy the whole folder",
        missing.join("; ")
    )))
}

impl Fields {
    /// Returns the ranges of each file with Gaussians of a level; parts of space without it have the next coarser one.
    ///
    /// # Errors
    /// A file that the list does not have; ranges that overlap.
    fn files_of(&self, level: u64) -> Result<BTreeMap<&str, Vec<Range<usize>>>, ImportError> {
        let damaged = |reason: &str| ImportError::damaged(format!("its lod-meta.json {reason}"));
        let mut files: BTreeMap<&str, Vec<Range<usize>>> = BTreeMap::new();
        let mut nodes = vec![&self.tree];
        while let Some(node) = nodes.pop() {
            nodes.extend(node.children.iter().rev());
            let Some(chunk) = (level..self.levels.min(MOST_LEVELS)).find_map(|level| node.lods.get(&level.to_string()))
            else {
                continue;
            };
            let name = self.filenames.get(chunk.file).ok_or_else(|| damaged("names a file that is not in its list"))?;
            let end = chunk.offset.checked_add(chunk.count).ok_or_else(|| damaged("has a range beyond every file"))?;
            files.entry(name).or_default().push(chunk.offset..end);
        }
        for ranges in files.values_mut() {
            ranges.sort_by_key(|range| range.start);
            if ranges.windows(2).any(|pair| pair[1].start < pair[0].end) {
                return Err(damaged("has Gaussians twice"));
            }
        }
        Ok(files)
    }
}

/// The Gaussians of a level.
struct Level {
    columns: Columns,
    /// The number of files whose Gaussians were trained with the filter of Mip-Splatting.
    filtered: usize,
    /// What they lose.
    lost: Vec<String>,
}

/// Reads the Gaussians of a level, file by file.
fn level_of(beside: &dyn Beside, files: &BTreeMap<&str, Vec<Range<usize>>>) -> Result<Level, ImportError> {
    let (mut all, mut lost, mut filtered) = (None, Vec::new(), 0);
    for (name, ranges) in files {
        let own = still(beside, name, Some(ranges))?;
        let several = files.len() > 1;
        lost.extend(
            own.lost.into_iter().map(|text| if several { format!("{}: {text}", printable(name)) } else { text }),
        );
        filtered += usize::from(own.columns.mip_filter);
        match &mut all {
            None => all = Some(own.columns),
            Some(all) => all.append(own.columns),
        }
    }
    let columns: Columns = all.ok_or_else(|| ImportError::damaged("its lod-meta.json has no Gaussians"))?;
    Ok(Level { columns, filtered, lost })
}

/// Reads the Gaussians of one `meta.json`.
fn still(beside: &dyn Beside, name: &str, ranges: Option<&[Range<usize>]>) -> Result<Still, ImportError> {
    let meta = meta::parse(&printable(name), &beside.read(name)?)?;
    let folder = name.rsplit_once('/').map_or("", |(folder, _)| folder);
    sog2::columns(&mut Files::beside(beside, folder), &meta, ranges)
}
