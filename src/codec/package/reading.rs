//! The reading of a package in steps, so that a program can go on between them.
//!
//! In: a reader that contains a package and nothing else. Out: after any number of steps, its scene. A step reads the bytes of a section,
//! decompresses a piece of it, or writes a piece into the scene.

use super::attribute::Attribute;
use super::envelope;
use super::error::PackageError;
use super::header::{Header, LEVEL};
use super::room::{Room, of_level};
use super::section::Section;
use super::{layout, options, planes};
use crate::codec::options::ReadOptions;
use crate::codec::zstd_frames::Decoder;
use crate::scene::{GaussianScene, Level, RuntimeScene, SceneForm};
use std::io::{BufReader, Cursor, Read, Seek};
use std::sync::Arc;

/// A package of which some sections have been read.
pub(crate) struct Reading<R> {
    reader: BufReader<R>,
    room: Room,
    sections: Sections,
    /// The level of detail that is being read, and those that have been.
    level: Option<(Cursor<Vec<u8>>, Sections)>,
    levels: Vec<RuntimeScene>,
}

/// The sections of a package, without levels of detail, of which some have been read.
struct Sections {
    header: Header,
    attributes: Vec<Attribute>,
    scene: GaussianScene,
    /// Index of the next section, and the one that is being decompressed.
    next: usize,
    begun: Option<Begun>,
    /// Memory of the bytes of a section, compressed and decompressed.
    body: Vec<u8>,
    planes: Vec<u8>,
}

/// A section that is being decompressed.
struct Begun {
    section: usize,
    attribute: usize,
    decoder: Decoder,
    /// Bytes decompressed, and rows written into the scene.
    decoded: usize,
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
        let room = Room::of(&header, file_length);
        Ok(Self { reader, room, sections: Sections::new(header)?, level: None, levels: Vec::new() })
    }

    /// Does one step, which decompresses or writes about `bytes` at most. Returns whether there is more to do.
    ///
    /// # Errors
    /// A damaged section.
    pub(crate) fn advance(&mut self, bytes: usize) -> Result<bool, PackageError> {
        let index = self.levels.len();
        if let Some((body, sections)) = &mut self.level {
            if matches!(sections.advance(body, bytes).map_err(of_level(index))?, Step::None)
                && let Some((_, sections)) = self.level.take()
            {
                self.levels.push(sections.into_level().map_err(of_level(index))?);
            }
            return Ok(true);
        }
        match self.sections.advance(&mut self.reader, bytes)? {
            Step::Part => Ok(true),
            Step::Level(body) => {
                let (header, start) = self.room.header_of_level(&body).map_err(of_level(index))?;
                let mut body = Cursor::new(body);
                body.set_position(start);
                self.level = Some((body, Sections::new(header).map_err(of_level(index))?));
                Ok(true)
            }
            Step::None => Ok(false),
        }
    }

    /// Returns the part of the sections that has been read, 0 to 1.
    pub(crate) fn progress(&self) -> f32 {
        let Sections { header, next, begun, .. } = &self.sections;
        let length = |section: &Section| section.length as f64;
        let all: f64 = header.sections.iter().map(length).sum();
        let read: f64 = header.sections.iter().take(*next).map(length).sum();
        let left = begun.as_ref().and_then(|begun| {
            let section = header.sections.get(begun.section)?;
            Some(length(section) * (1.0 - begun.decoded as f64 / section.raw_length.max(1) as f64))
        });
        ((read - left.unwrap_or(0.0)) / all.max(1.0)) as f32
    }

    /// Does all remaining steps, and returns the scene, whose parts fit together.
    ///
    /// # Errors
    /// A damaged section; parts that contradict each other.
    pub(crate) fn finish(mut self) -> Result<GaussianScene, PackageError> {
        while self.advance(usize::MAX)? {}
        let Sections { header, mut scene, .. } = self.sections;
        let sized = header.levels.iter().zip(self.levels);
        scene.levels = sized.map(|(stored, scene)| Level { pixels: stored.pixels, scene: Arc::new(scene) }).collect();
        scene.check().map_err(PackageError::Inconsistent)?;
        Ok(scene)
    }

    /// Does all remaining steps, and returns the scene with its settings replaced by the options that are given.
    ///
    /// # Errors
    /// As [`finish`](Self::finish); options that contradict the stored Gaussians.
    pub(crate) fn finish_with(self, options: &ReadOptions) -> Result<GaussianScene, PackageError> {
        let mut scene = self.finish()?;
        options::apply(options, &mut scene)?;
        Ok(scene)
    }
}

impl Sections {
    /// Creates a blank scene for the sections of a checked header.
    fn new(header: Header) -> Result<Self, PackageError> {
        let scene = layout::blank(&header);
        // Values are written at positions from the header: the tables must have the sizes of the header.
        header.check_scene(&scene)?;
        let attributes = header.attributes();
        let (body, planes) = Default::default();
        Ok(Self { header, attributes, scene, next: 0, begun: None, body, planes })
    }

    /// Does one step with about `bytes`.
    fn advance(&mut self, reader: &mut impl Read, bytes: usize) -> Result<Step, PackageError> {
        if self.begun.is_some() {
            self.advance_begun(bytes)?;
            return Ok(Step::Part);
        }
        let Some(section) = self.header.sections.get(self.next) else { return Ok(Step::None) };
        section.read_body(reader, &mut self.body)?;
        self.next += 1;
        if let Some(attribute) = self.attributes.iter().position(|attribute| attribute.name == section.name) {
            self.planes.clear();
            self.planes.resize(section.raw_length, 0);
            let decoder = Decoder::new(std::mem::take(&mut self.body)).map_err(|e| damaged(section, e.to_string()))?;
            self.begun = Some(Begun { section: self.next - 1, attribute, decoder, decoded: 0, joined: 0 });
        } else if section.name == LEVEL {
            return Ok(Step::Level(std::mem::take(&mut self.body)));
        }
        Ok(Step::Part)
    }

    /// Decompresses or writes the next piece of the section that has been begun.
    fn advance_begun(&mut self, bytes: usize) -> Result<(), PackageError> {
        let Some(begun) = &mut self.begun else { return Ok(()) };
        let Some(section) = self.header.sections.get(begun.section) else { return Ok(()) };
        let Some(attribute) = self.attributes.get(begun.attribute) else { return Ok(()) };
        if begun.decoded < section.raw_length {
            let end = section.raw_length.min(begun.decoded.saturating_add(bytes.max(1)));
            let piece = self.planes.get_mut(begun.decoded..end).unwrap_or_default();
            let found = begun.decoder.fill(piece).map_err(|e| damaged(section, e.to_string()))?;
            begun.decoded += found;
            if found < piece.len() {
                let reason = format!("it holds {} bytes instead of {}", begun.decoded, section.raw_length);
                return Err(damaged(section, reason));
            }
            return Ok(());
        }
        if begun.joined < section.count {
            let rows = (bytes / (attribute.width * 4).max(1)).max(1);
            let end = section.count.min(begun.joined.saturating_add(rows));
            let words = layout::words_mut(&mut self.scene, attribute.name);
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
            self.body = begun.decoder.into_frame();
        }
        Ok(())
    }

    /// Returns the scene of a level of detail of which all sections have been read.
    fn into_level(self) -> Result<RuntimeScene, PackageError> {
        let SceneForm::Ready(form) = self.scene.form else {
            return Err(PackageError::Inconsistent("a level of detail in the trained form"));
        };
        let GaussianScene { environment, filter, trained_with, playback, .. } = self.scene;
        Ok(RuntimeScene { form, environment, filter, trained_with, playback, levels: Vec::new() })
    }
}

fn damaged(section: &Section, reason: String) -> PackageError {
    PackageError::SectionBody { name: section.name.clone(), reason }
}
