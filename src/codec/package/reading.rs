//! Reading a package in steps, so that a program can do other work between them.
//!
//! In: a reader that contains a package and nothing else. Out: after any number of steps, its scene. A step allocates a
//! piece of the scene, reads a piece of a section, decompresses one, or writes one into the scene. Of an index that
//! chunk files follow, the scene is the capture of these, or the index alone.

use super::attribute::Attribute;
use super::colliders::ColliderWords;
use super::envelope;
use super::error::PackageError;
use super::header::{Header, LEVEL};
use super::memory_limit::{MemoryLimit, of_chunk, of_level};
use super::section::{Body, Section};
use super::{layout, options, planes};
use crate::codec::options::ReadOptions;
use crate::codec::zstd_frames::{Decoder, Memory};
use crate::scene::union::{Union, Unlike};
use crate::scene::{ColorCodebooks, Form, GaussianScene, Level, PackedColors, RuntimeScene, SceneForm};
use std::io::{BufReader, Cursor, Read, Seek};
use std::sync::Arc;

/// A package of which some sections have been read.
pub(crate) struct Reading<R> {
    reader: BufReader<R>,
    limit: MemoryLimit,
    sections: Sections,
    /// The package within the file that is being read: a level of detail, or a chunk file that follows an index.
    part: Option<(Cursor<Vec<u8>>, Sections)>,
    /// The levels of detail that have been read.
    levels: Vec<RuntimeScene>,
    /// Whether the index alone is read, the number of chunk files that have been read, and the capture of them.
    is_index: bool,
    files: usize,
    union: Option<Union>,
    /// Whether the temporal filter of the first chunk file is stored as bits, if it has one.
    bits: Option<Option<bool>>,
}

/// The sections of a package, without levels of detail, of which some have been read.
struct Sections {
    header: Header,
    attributes: Vec<Attribute>,
    scene: GaussianScene,
    /// The words of the colliders, which the scene gets when all sections have been read.
    colliders: ColliderWords,
    /// Whether the scene has all of its values, which are zero until they have been read.
    is_grown: bool,
    /// Index of the next section, and what has been begun: its body, or the decompression of the section before.
    next: usize,
    body: Option<Body>,
    begun: Option<Begun>,
    /// Memory of the bytes of a section, compressed and decompressed.
    memory: Memory,
    planes: Vec<u8>,
}

/// A section that is being decompressed.
struct Begun {
    section: usize,
    attribute: usize,
    decoder: Decoder,
    /// Rows written into the scene.
    joined: usize,
}

/// What a step has done.
enum Step {
    /// A part of the work.
    Part,
    /// Read the section of a level of detail, which is a package.
    Level(Vec<u8>),
    /// Nothing: all sections have been read.
    None,
}

impl<R: Read + Seek> Reading<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// A damaged header.
    pub(crate) fn new(reader: R) -> Result<Self, PackageError> {
        let mut reader = BufReader::new(reader);
        let (header, file_length) = envelope::read(&mut reader)?;
        Ok(Self::of(reader, header, file_length, false))
    }

    /// Reads the header of an index that chunk files follow, of which the reader has `bytes` bytes: all up to the first
    /// of these. The scene is the index alone.
    ///
    /// # Errors
    /// A damaged header.
    pub(crate) fn of_index(reader: R, bytes: u64) -> Result<Self, PackageError> {
        let mut reader = BufReader::new(reader);
        let (header, length) = envelope::read_index(&mut reader, bytes)?;
        Ok(Self::of(reader, header, length, true))
    }

    fn of(reader: BufReader<R>, header: Header, file_length: u64, is_index: bool) -> Self {
        let limit = MemoryLimit::of(&header, file_length);
        let (part, levels, files, union, bits) = Default::default();
        Self { reader, limit, sections: Sections::new(header), part, levels, is_index, files, union, bits }
    }

    /// Does one step, which decompresses or writes about `bytes` at most. Returns whether there is more to do.
    ///
    /// # Errors
    /// A damaged section.
    pub(crate) fn advance(&mut self, bytes: usize) -> Result<bool, PackageError> {
        let index = self.levels.len();
        if let Some((body, sections)) = &mut self.part {
            let number = Some(self.files).filter(|_| self.sections.header.chunks_follow);
            let within = |error| match number {
                Some(number) => of_chunk(number)(error),
                None => of_level(index)(error),
            };
            if matches!(sections.advance(body, bytes).map_err(within)?, Step::None)
                && let Some((_, sections)) = self.part.take()
            {
                match number {
                    Some(_) => self.unite(sections).map_err(within)?,
                    None => self.levels.push(sections.into_level().map_err(within)?),
                }
            }
            return Ok(true);
        }
        match self.sections.advance(&mut self.reader, bytes)? {
            Step::Part => Ok(true),
            Step::Level(body) => {
                let (header, start) = self.limit.header_of_level(&body).map_err(of_level(index))?;
                let mut body = Cursor::new(body);
                body.set_position(start);
                self.part = Some((body, Sections::new(header)));
                Ok(true)
            }
            Step::None => self.begin_file().map_err(of_chunk(self.files)),
        }
    }

    /// Begins to read the next chunk file. Returns whether there is one.
    fn begin_file(&mut self) -> Result<bool, PackageError> {
        let files = self.sections.header.files_that_follow();
        let Some(file) = files.get(self.files).filter(|_| !self.is_index) else { return Ok(false) };
        // The header was checked against the length of the file.
        let mut body = Vec::new();
        Read::by_ref(&mut self.reader).take(file.bytes).read_to_end(&mut body)?;
        let (header, start) = self.limit.header_of_chunk(&body, file)?;
        let mut body = Cursor::new(body);
        body.set_position(start);
        self.part = Some((body, Sections::new(header)));
        Ok(true)
    }

    /// Appends a chunk file of which all sections have been read.
    fn unite(&mut self, sections: Sections) -> Result<(), PackageError> {
        let needs_codebooks = sections.header.codebooks_in_index;
        // Sets in two forms become bits, of which a small file may need any number.
        let bits = sections.header.filter.map(|filter| filter.bits);
        if *self.bits.get_or_insert(bits) != bits {
            return Err(PackageError::Inconsistent("it has a temporal filter in another form than the first"));
        }
        let mut scene = sections.into_scene();
        if needs_codebooks {
            let codebooks = self.sections.scene.form.codebooks();
            supply(&mut scene, Some(codebooks.ok_or(PackageError::Inconsistent("its index has no codebooks"))?))?;
        }
        scene.check().map_err(PackageError::Inconsistent)?;
        self.files += 1;
        let Some(all) = &mut self.union else {
            self.union = Some(Union::new(scene));
            return Ok(());
        };
        all.append(scene).map_err(|unlike| {
            PackageError::Inconsistent(match unlike {
                Unlike::Settings => "it has other settings than the first",
                Unlike::Form => "its Gaussians have another form than those of the first",
                Unlike::Filter => "it has another temporal filter than the first",
            })
        })
    }

    /// Returns the part of the sections that has been read, 0 to 1.
    pub(crate) fn progress(&self) -> f32 {
        let Sections { header, next, begun, planes, .. } = &self.sections;
        let length = |section: &Section| section.length as f64;
        let all: f64 = header.sections.iter().map(length).sum();
        let read: f64 = header.sections.iter().take(*next).map(length).sum();
        let left = begun.as_ref().and_then(|begun| {
            let section = header.sections.get(begun.section)?;
            Some(length(section) * (1.0 - planes.len() as f64 / section.raw_length.max(1) as f64))
        });
        let files = header.files_that_follow().iter().filter(|_| !self.is_index).map(|file| file.bytes as f64);
        let (all, read) = (all + files.clone().sum::<f64>(), read + files.take(self.files).sum::<f64>());
        ((read - left.unwrap_or(0.0)) / all.max(1.0)) as f32
    }

    /// Returns whether the package is a chunk file whose codebooks are in the index beside it.
    pub(crate) fn needs_codebooks(&self) -> bool {
        self.sections.header.codebooks_in_index
    }

    /// Does all remaining steps, and returns the scene, whose parts fit together. `codebooks` are those of the index,
    /// if the package [needs](Self::needs_codebooks) them.
    ///
    /// # Errors
    /// A damaged section; parts that contradict each other; codebooks that are missing, or are others.
    pub(crate) fn finish(mut self, codebooks: Option<&Arc<ColorCodebooks>>) -> Result<GaussianScene, PackageError> {
        while self.advance(usize::MAX)? {}
        if self.needs_codebooks() {
            supply(&mut self.sections.scene, codebooks)?;
        }
        let Self { mut sections, levels, union, .. } = self;
        if let Some(scene) = union.map(Union::finish) {
            scene.check().map_err(PackageError::Inconsistent)?;
            return Ok(scene);
        }
        let sized = std::mem::take(&mut sections.header.levels).into_iter().zip(levels);
        let levels = sized.map(|(stored, scene)| Level { pixels: stored.pixels, scene: Arc::new(scene) }).collect();
        let scene = GaussianScene { levels, ..sections.into_scene() };
        scene.check().map_err(PackageError::Inconsistent)?;
        Ok(scene)
    }

    /// Does all remaining steps, and returns the scene with its settings replaced by the options that are given.
    ///
    /// # Errors
    /// As [`finish`](Self::finish); options that contradict the stored Gaussians.
    pub(super) fn finish_with(
        self,
        codebooks: Option<&Arc<ColorCodebooks>>,
        options: &ReadOptions,
    ) -> Result<GaussianScene, PackageError> {
        let mut scene = self.finish(codebooks)?;
        options::apply(options, &mut scene)?;
        Ok(scene)
    }
}

/// Gives a scene that has been read the codebooks of an index.
fn supply(scene: &mut GaussianScene, codebooks: Option<&Arc<ColorCodebooks>>) -> Result<(), PackageError> {
    let fault = |fault: &str| PackageError::CodebooksOfIndex { fault: fault.to_owned() };
    let codebooks = codebooks.ok_or_else(|| fault("which is not there: keep them in one folder"))?;
    let SceneForm::Ready(Form::Packed(packed)) = &mut scene.form else { return Ok(()) };
    let PackedColors::Coded(colors) = &mut packed.colors else { return Ok(()) };
    if colors.codebooks.entries != codebooks.entries {
        return Err(fault("which is that of another capture: keep the files of each in a folder of its own"));
    }
    colors.codebooks = codebooks.clone();
    Ok(())
}

impl Sections {
    /// Creates an empty scene for the sections of a checked header.
    fn new(header: Header) -> Self {
        let (scene, attributes) = (layout::empty(&header), header.attributes());
        let (colliders, is_grown, next, body, begun, memory, planes) = Default::default();
        Self { header, attributes, scene, colliders, is_grown, next, body, begun, memory, planes }
    }

    /// Does one step with about `bytes`.
    fn advance(&mut self, reader: &mut impl Read, bytes: usize) -> Result<Step, PackageError> {
        let bytes = bytes.max(1);
        if !self.is_grown {
            if !layout::grow(&mut self.scene, &mut self.colliders, &self.header, bytes) {
                return Ok(Step::Part);
            }
            // Values are written at positions from the header: the tables must have the sizes of the header.
            self.header.check_scene(&self.scene, &self.colliders)?;
            self.is_grown = true;
        }
        if self.begun.is_some() {
            self.advance_begun(bytes)?;
            return Ok(Step::Part);
        }
        let Some(section) = self.header.sections.get(self.next) else { return Ok(Step::None) };
        let frame = &mut self.memory.frame;
        let mut body = match self.body.take() {
            Some(body) => body,
            None => section.begin_body(reader, frame)?,
        };
        if !section.read_some(reader, &mut body, frame, bytes)? {
            self.body = Some(body);
            return Ok(Step::Part);
        }
        self.next += 1;
        if let Some(attribute) = self.attributes.iter().position(|attribute| attribute.name == section.name) {
            self.planes.clear();
            self.planes.reserve(section.raw_length);
            let memory = std::mem::take(&mut self.memory);
            let decoder = Decoder::new(memory).map_err(|e| damaged(section, e.to_string()))?;
            self.begun = Some(Begun { section: self.next - 1, attribute, decoder, joined: 0 });
        } else if section.name == LEVEL {
            return Ok(Step::Level(std::mem::take(&mut self.memory.frame)));
        }
        Ok(Step::Part)
    }

    /// Decompresses or writes the next piece of the section that has been begun.
    fn advance_begun(&mut self, bytes: usize) -> Result<(), PackageError> {
        let Some(begun) = &mut self.begun else { return Ok(()) };
        let Some(section) = self.header.sections.get(begun.section) else { return Ok(()) };
        let Some(attribute) = self.attributes.get(begun.attribute) else { return Ok(()) };
        let decoded = self.planes.len();
        if decoded < section.raw_length {
            self.planes.resize(section.raw_length.min(decoded.saturating_add(bytes)), 0);
            let piece = self.planes.get_mut(decoded..).unwrap_or_default();
            let (count, has_ended) = begun.decoder.advance(piece).map_err(|e| damaged(section, e.to_string()))?;
            let decoded = decoded + count;
            self.planes.truncate(decoded);
            return match has_ended {
                false => Ok(()),
                true => Err(damaged(section, format!("it holds {decoded} bytes instead of {}", section.raw_length))),
            };
        }
        if begun.joined < section.count {
            let rows = (bytes / (attribute.width * 4).max(1)).max(1);
            let end = section.count.min(begun.joined.saturating_add(rows));
            let words = layout::words_mut(&mut self.scene, &mut self.colliders, attribute.name);
            let rows = section.first..section.first + section.count;
            planes::join(&self.planes, attribute, rows, begun.joined..end, words);
            begun.joined = end;
            if end < section.count {
                return Ok(());
            }
        }
        // A frame that holds more is refused.
        if begun.decoder.fill(&mut [0]).map_err(|e| damaged(section, e.to_string()))? > 0 {
            return Err(damaged(section, format!("it holds more than {} bytes", section.raw_length)));
        }
        if let Some(begun) = self.begun.take() {
            self.memory = begun.decoder.into_memory();
        }
        Ok(())
    }

    /// Returns the scene, without levels of detail, of which all sections have been read. Its parts are not checked.
    fn into_scene(self) -> GaussianScene {
        let Self { header, scene, colliders, .. } = self;
        let colliders = header.colliders.map(|stored| Arc::new(colliders.into_colliders(&stored)));
        GaussianScene { colliders, ..scene }
    }

    /// Returns the scene of a level of detail of which all sections have been read.
    fn into_level(self) -> Result<RuntimeScene, PackageError> {
        self.into_scene().into_ready(|form| match form {
            SceneForm::Ready(form) => Ok(form),
            SceneForm::Trained(_) => Err(PackageError::Inconsistent("a level of detail in the trained form")),
        })
    }
}

fn damaged(section: &Section, reason: String) -> PackageError {
    PackageError::SectionBody { name: section.name.clone(), reason }
}
