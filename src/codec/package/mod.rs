//! The package format `.gs4d`: written once, loaded often, with a checksum on every byte.
//!
//! In: a [`GaussianScene`]. Out: a file, and from it the same scene, bit for bit, apart from the points of colliders,
//! which are [rounded](crate::scene::Colliders::rounded). `docs/format.md` has the layout.
//!
//! A package is a fixed start ([`MAGIC`], [`VERSION`], length and checksum of the header), a [`Header`] in RON, and the
//! sections that the header lists. A section holds one attribute of a run of Gaussians, split into byte planes
//! (`planes`), compressed and checksummed on its own. The order is geometry and first color coefficients, layer by layer
//! so that a [`Beginning`] of the file can be drawn, the other coefficients, temporal filter, environment map,
//! colliders, the sound, levels of detail, each of which is a package itself. A reader skips unknown sections, and
//! refuses a package whose header requires an unknown feature. The chunk files of a capture, packages themselves, may follow
//! their index in one file: a reader that has all of it reads the capture, a player reads the index and then parts.

mod attribute;
mod beginning;
mod check;
mod colliders;
mod envelope;
mod error;
mod header;
mod layout;
mod memory_limit;
mod options;
mod planes;
mod reading;
pub(crate) mod section;

pub use beginning::Beginning;
pub use colliders::{StoredColliders, StoredMesh, StoredStretch};
pub use envelope::{MAGIC, VERSION};
pub use error::PackageError;
pub use header::{EnvironmentSize, Header, StoredFilter, StoredForm, StoredLevel};
pub(crate) use reading::Reading;
pub use section::Section;

use super::import::source::Beside;
use super::options::ReadOptions;
use crate::scene::{ChunkTable, ColorCodebooks, GaussianScene};
use attribute::Attribute;
use colliders::ColliderWords;
use header::{LEVEL, Role};
use memory_limit::{MemoryLimit, of_level};
use rayon::prelude::*;
use serde::Serialize;
use std::io::{BufReader, Cursor, Read, Seek, Write};
use std::sync::Arc;

/// Extensions of packages, without the dot.
pub(crate) const EXTENSIONS: &[&str] = &["gs4d"];

/// Largest number of Gaussians per section: few enough to decode one in little memory, enough to compress well.
const ROWS_PER_SECTION: usize = 1 << 14;

/// Largest number of Gaussians per section of records of the packed form, whose columns compress best in one piece.
const PACKED_ROWS_PER_SECTION: usize = 1 << 20;

/// Largest width, in words, of an attribute with [`PACKED_ROWS_PER_SECTION`] rows per section.
const PACKED_WORDS: usize = 8;

/// How a package is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteSettings {
    /// zstd level, 1 (fast) to 19 (small); values outside are clamped. Default: 9.
    pub level: i32,
}

impl Default for WriteSettings {
    fn default() -> Self {
        Self { level: 9 }
    }
}

/// The header of a package, and which of its sections are damaged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PackageInfo {
    /// Format version.
    pub version: u32,
    /// Bytes of the whole package.
    pub file_length: u64,
    /// The header; its checksum is correct.
    pub header: Header,
    /// Bytes of the package after which each layer can be drawn coarsely ([`Beginning::layers`]).
    pub layers: Vec<usize>,
    /// Indices in `header.sections` of the sections with a wrong checksum or length.
    pub damaged: Vec<usize>,
    /// Numbers, from 0, of the chunk files that follow and are damaged.
    pub damaged_files: Vec<usize>,
}

impl PackageInfo {
    /// Returns whether every checksum is correct.
    pub fn is_intact(&self) -> bool {
        self.damaged.is_empty() && self.damaged_files.is_empty()
    }

    /// Returns what is damaged, in words; `None` if every checksum is correct.
    pub fn damage(&self) -> Option<String> {
        let (files, sections) = (self.header.files_that_follow().len(), self.header.sections.len());
        match (self.damaged.len(), self.damaged_files.len()) {
            (0, 0) => None,
            (0, damaged) => Some(format!("{damaged} of {files} chunk files are damaged")),
            (damaged, _) => Some(format!("{damaged} of {sections} sections are damaged")),
        }
    }
}

/// Writes a scene without loss, apart from the points of colliders, which are
/// [rounded](crate::scene::Colliders::rounded). The same scene and settings give the same bytes.
///
/// # Errors
/// [`PackageError::Inconsistent`] for a scene whose parts do not fit together, [`PackageError::TooLarge`] for a scene
/// that compresses so well that a reader would refuse it as a decompression bomb, and errors of the writer.
pub fn write<W: Write>(writer: W, scene: &GaussianScene, settings: &WriteSettings) -> Result<(), PackageError> {
    write_with(writer, scene, settings, Role::Whole)
}

/// As [`write()`], of a chunk file: the codebooks of its colors are left to the index of the capture.
///
/// # Errors
/// As [`write()`].
pub(crate) fn write_chunk<W: Write>(
    writer: W,
    scene: &GaussianScene,
    settings: &WriteSettings,
) -> Result<(), PackageError> {
    write_with(writer, scene, settings, Role::Chunk)
}

/// As [`write()`], of the index of a capture whose chunk files, in the order of its table, are to be written right after
/// it.
///
/// # Errors
/// As [`write()`].
pub fn write_index<W: Write>(writer: W, scene: &GaussianScene, settings: &WriteSettings) -> Result<(), PackageError> {
    write_with(writer, scene, settings, Role::Index)
}

fn write_with<W: Write>(
    mut writer: W,
    scene: &GaussianScene,
    settings: &WriteSettings,
    role: Role,
) -> Result<(), PackageError> {
    if role != Role::Index && scene.chunks.as_ref().is_some_and(|table| table.first_byte.is_some()) {
        return Err(PackageError::Inconsistent("the index of chunk files in one file, which are not written with it"));
    }
    let mut header = Header::of(scene, role);
    let colliders = scene.colliders.as_deref().map(ColliderWords::of).unwrap_or_default();
    header.check_writable(scene, &colliders)?;
    let level = settings.level.clamp(1, 19);
    let is_packed = matches!(header.form, StoredForm::Packed { .. });
    let rows = |attribute: &Attribute| {
        if is_packed && attribute.width <= PACKED_WORDS { PACKED_ROWS_PER_SECTION } else { ROWS_PER_SECTION }
    };
    let (attributes, mut runs, mut before) = (header.attributes(), Vec::new(), 0);
    let written =
        |attribute: &Attribute, gaussians| attribute.rows_of(gaussians).filter(|_| gaussians > 0).unwrap_or(0);
    for &end in &header.layers {
        let layer = |a: &Attribute| a.runs(written(a, before)..written(a, end), rows(a));
        runs.extend(attributes.iter().flat_map(layer));
        before = end;
    }
    runs.extend(attributes.iter().flat_map(|a| a.runs(written(a, before)..a.rows, rows(a))));
    let encoded = runs
        .into_par_iter()
        .map(|(attribute, rows)| {
            let words = layout::words(scene, &colliders, attribute.name);
            section::encode(words, &attribute, rows, level)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let (mut sections, mut bodies): (Vec<_>, Vec<_>) = encoded.into_iter().unzip();
    let first_level = bodies.len();
    for (index, level) in scene.levels.iter().enumerate() {
        let mut body = Vec::new();
        let inner = GaussianScene::from(level.scene.as_ref().clone());
        write(&mut body, &inner, settings).map_err(of_level(index))?;
        sections.push(section::of_package(LEVEL, index, &body));
        bodies.push(body);
    }
    header.sections = sections;
    let mut memory = MemoryLimit::of(&header, envelope::write(&mut writer, &header)?);
    for (index, body) in bodies[first_level..].iter().enumerate() {
        memory.header_of_level(body).map_err(of_level(index))?;
    }
    for body in bodies {
        section::write_body(&mut writer, &body)?;
    }
    Ok(writer.flush()?)
}

/// Reads a scene from a reader that contains a package and nothing else. All checksums are verified, also those of
/// unknown sections. [`Loading`](crate::codec::Loading) does the same in steps.
///
/// Besides the scene, one section at a time is in memory, compressed and decompressed. The parts of the scene fit
/// together ([`GaussianScene::check`]); whether every Gaussian can be drawn, [`GaussianScene::into_runtime`] checks.
///
/// # Errors
/// One [`PackageError`] for each kind of damage.
pub fn read<R: Read + Seek>(reader: R) -> Result<GaussianScene, PackageError> {
    Reading::new(reader)?.finish(None)
}

/// Reads a scene as [`read`] does, and replaces its settings by the options that are given. The codebooks of a chunk
/// file are in a file beside it.
///
/// # Errors
/// As [`read`]; options that are invalid or contradict the stored Gaussians.
pub(super) fn read_with<R: Read + Seek>(
    reader: R,
    beside: &dyn Beside,
    options: &ReadOptions,
) -> Result<GaussianScene, PackageError> {
    options.check()?;
    finish_beside(Reading::new(reader)?, beside, options)
}

/// Returns the scene of a package of which some steps have been read, with its settings replaced by the options that are
/// given. The codebooks that a chunk file needs, and that are no option, are in a file beside it.
///
/// # Errors
/// As [`read`]; options that contradict the stored Gaussians.
pub(super) fn finish_beside<R: Read + Seek>(
    reading: Reading<R>,
    beside: &dyn Beside,
    options: &ReadOptions,
) -> Result<GaussianScene, PackageError> {
    let codebooks = match &options.codebooks {
        None if reading.needs_codebooks() => Some(codebooks_beside(beside)?),
        given => given.clone(),
    };
    reading.finish_with(codebooks.as_ref(), options)
}

/// Reads a chunk file with the codebooks of its capture.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_chunk<R: Read + Seek>(
    reader: R,
    codebooks: Option<&Arc<ColorCodebooks>>,
) -> Result<GaussianScene, PackageError> {
    Reading::new(reader)?.finish(codebooks)
}

/// Reads the codebooks of the index beside chunk files.
///
/// # Errors
/// [`PackageError::CodebooksOfIndex`].
fn codebooks_beside(beside: &dyn Beside) -> Result<Arc<ColorCodebooks>, PackageError> {
    let unusable = |fault: String| PackageError::CodebooksOfIndex { fault };
    let bytes = beside.read(ChunkTable::INDEX).map_err(|error| unusable(format!("which cannot be read: {error}")))?;
    let index = read(Cursor::new(bytes)).map_err(|error| unusable(format!("which cannot be read: {error}")))?;
    index.form.codebooks().cloned().ok_or_else(|| unusable("which has no codebooks".to_owned()))
}

/// Whether chunk files follow an index in one file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Following {
    /// Further bytes decide.
    Undecided,
    /// None do, or the file is no package that can be read.
    Nothing,
    /// They do, from this byte on, counted from the start of the file.
    From(u64),
}

impl Following {
    /// Returns whether chunk files follow, by the first bytes of a file.
    pub fn of(bytes: &[u8]) -> Self {
        match envelope::read_beginning(bytes) {
            Ok(None) => Self::Undecided,
            Ok(Some((header, start))) if header.chunks_follow => Self::From(header.end(start)),
            Ok(Some(_)) | Err(_) => Self::Nothing,
        }
    }
}

/// Reads the header and verifies every checksum, without building the scene.
///
/// # Errors
/// As [`read`], but damaged sections are listed in the result instead.
pub fn inspect<R: Read + Seek>(reader: R) -> Result<PackageInfo, PackageError> {
    let mut reader = BufReader::new(reader);
    let (header, file_length, damaged) = inspect_sections(&mut reader)?;
    let (mut body, mut damaged_files) = (Vec::new(), Vec::new());
    for (number, file) in header.files_that_follow().iter().enumerate() {
        body.clear();
        Read::by_ref(&mut reader).take(file.bytes).read_to_end(&mut body)?;
        let is_intact = inspect_sections(&mut Cursor::new(&body))
            .is_ok_and(|(header, _, damaged)| header.check_chunk(file).is_ok() && damaged.is_empty());
        if !is_intact {
            damaged_files.push(number);
        }
    }
    let layers = Beginning::of_header(&header, file_length - header.length(0)).layers().to_vec();
    Ok(PackageInfo { version: VERSION, file_length, header, layers, damaged, damaged_files })
}

/// Reads the header and verifies the checksum of every section. Returns the header, the length of the file and the indices
/// of the damaged sections.
fn inspect_sections(reader: &mut (impl Read + Seek)) -> Result<(Header, u64, Vec<usize>), PackageError> {
    let (header, file_length) = envelope::read(reader)?;
    let (mut body, mut damaged) = (Vec::new(), Vec::new());
    for (index, section) in header.sections.iter().enumerate() {
        match section.read_body(reader, &mut body) {
            Ok(()) => {}
            Err(PackageError::SectionChecksum { .. } | PackageError::SectionLength { .. }) => damaged.push(index),
            Err(other) => return Err(other),
        }
    }
    Ok((header, file_length, damaged))
}
