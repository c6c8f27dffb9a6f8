//! Streamed SOG: levels of detail, each of several SOG folders.
//!
//! In: `lod-meta.json` and the folders beside it. Out: a scene of the finest level whose folders are all there, y down.

use super::files::Files;
use super::meta;
use super::sog2::{Described, Still, UP};
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
        match level_of(beside, &files, fields.environment.as_deref()) {
            Ok(Level { mut columns, mut filtered, mut lost, around }) => {
                if !missing.is_empty() {
                    lost.push(format!(
                        "This is level {level} of its levels of detail, with {} Gaussians: files of the finer levels are missing ({}).",
                        columns.len(),
                        missing.join("; ")
                    ));
                }
                let mut parts = files.len();
                if let Some(around) = around {
                    match around.and_then(|around| around.still(beside, None)) {
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
struct Level<'n> {
    columns: Columns,
    /// The number of files whose Gaussians were trained with the filter of Mip-Splatting.
    filtered: usize,
    /// What they lose.
    lost: Vec<String>,
    /// The surroundings, if there are any.
    around: Option<Result<Part<'n>, ImportError>>,
}

/// A `meta.json` with Gaussians, not yet read.
struct Part<'n> {
    name: &'n str,
    described: Described,
}

/// Reads the Gaussians of a level, file by file, once the files of all of them are there.
fn level_of<'n>(
    beside: &dyn Beside,
    files: &BTreeMap<&'n str, Vec<Range<usize>>>,
    environment: Option<&'n str>,
) -> Result<Level<'n>, ImportError> {
    let described = parts(beside, files.keys().copied())?;
    let around = match environment.map(|name| parts(beside, [name])) {
        Some(Err(ImportError::Io(error))) if error.kind() == io::ErrorKind::WouldBlock => return Err(error.into()),
        around => around.and_then(|around| around.map(|mut parts| parts.pop()).transpose()),
    };
    let (mut all, mut lost, mut filtered) = (None, Vec::new(), 0);
    for (part, ranges) in described.iter().zip(files.values()) {
        let own = part.still(beside, Some(ranges))?;
        let several = files.len() > 1;
        let name = printable(part.name);
        lost.extend(own.lost.into_iter().map(|text| if several { format!("{name}: {text}") } else { text }));
        filtered += usize::from(own.columns.mip_filter);
        match &mut all {
            None => all = Some(own.columns),
            Some(all) => all.append(own.columns),
        }
    }
    let columns: Columns = all.ok_or_else(|| ImportError::damaged("its lod-meta.json has no Gaussians"))?;
    Ok(Level { columns, filtered, lost, around })
}

/// Reads files `meta.json`, and announces all their textures.
fn parts<'n>(beside: &dyn Beside, names: impl IntoIterator<Item = &'n str>) -> Result<Vec<Part<'n>>, ImportError> {
    let names: Vec<&str> = names.into_iter().collect();
    beside.announce(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>())?;
    let part = |name: &'n str| -> Result<Part<'n>, ImportError> {
        let meta = meta::parse(&printable(name), &beside.read(name)?)?;
        Ok(Part { name, described: Described::of(&meta)? })
    };
    let parts = names.into_iter().map(part).collect::<Result<Vec<_>, _>>()?;
    let textures: Vec<String> = parts.iter().flat_map(Part::textures).collect();
    beside.announce(&textures)?;
    Ok(parts)
}

impl Part<'_> {
    /// Returns its folder, empty or with a slash at its end.
    fn folder(&self) -> &str {
        self.name.rfind('/').map_or("", |slash| &self.name[..=slash])
    }

    /// Returns the paths of its textures.
    fn textures(&self) -> impl Iterator<Item = String> {
        let folder = self.folder();
        self.described.textures().map(move |name| format!("{folder}{name}"))
    }

    /// Reads its Gaussians: those in the ranges given, or all.
    fn still(&self, beside: &dyn Beside, ranges: Option<&[Range<usize>]>) -> Result<Still, ImportError> {
        self.described.still(&mut Files::beside(beside, self.folder().trim_end_matches('/')), ranges)
    }
}
