//! The capture of a file: the file itself, or one capture inside of it.
//!
//! In: a file, and the others of its folder. Out: [`Found`], which reads the scene. Gzip and zip archives that are no
//! format of captures are looked into, once: what gzip has packed, and the only capture of an archive, whatever their
//! names.

use super::budget::Budget;
use super::error::CodecErrorKind;
use super::format::{self, Format, Read};
use super::import::source::{Others, Source};
use super::import::{ImportError, Imported, sequence};
use super::in_archive::{Archive, Contents};
use super::input::Input;
use super::looks::{self, GZIP};
use super::options::ReadOptions;
use super::start::{Start, ZIP};
use super::text::printable;
use flate2::read::MultiGzDecoder;
use std::io::Seek;
use std::path::{Path, PathBuf};

/// Most names of files in an error.
const NAMED: usize = 6;

/// A capture, not yet read.
pub(super) struct Found<'p> {
    /// Its format, which is that of a file.
    pub format: Format,
    /// Its bytes.
    pub input: Input,
    /// Its path, or its name in the archive.
    pub name: PathBuf,
    /// The other files of its folder.
    others: Others<'p>,
    /// Whether it is in an archive.
    is_inside: bool,
}

impl<'p> Found<'p> {
    /// Finds the capture of a file. `others` are the other files of its folder.
    ///
    /// # Errors
    /// A file that cannot be read, or in which no capture is, or several are.
    pub(super) fn of(mut input: Input, path: &Path, others: Others<'p>) -> Result<Self, CodecErrorKind> {
        let start = Start::of(&mut input, path)?;
        match Format::of(&start) {
            Some(format) => Ok(Self { format, input, name: path.to_owned(), others, is_inside: false }),
            None if start.bytes.starts_with(GZIP) => Self::unzipped(input, path, others, &start),
            None if start.bytes.starts_with(ZIP) => Self::only(input, &start),
            None => Err(unknown(&start)),
        }
    }

    /// Finds what gzip has packed.
    fn unzipped(input: Input, path: &Path, others: Others<'p>, start: &Start) -> Result<Self, CodecErrorKind> {
        let bytes = Budget::of(start.length).unpack(MultiGzDecoder::new(input));
        let bytes = bytes.map_err(|error| ImportError::damaged(format!("what gzip has packed in it {error}")))?;
        let name = if ["gz", "gzip"].contains(&&*start.extension) { path.with_extension("") } else { path.to_owned() };
        let mut input = Input::of(bytes);
        let start = Start::of(&mut input, &name)?;
        match Format::of(&start) {
            Some(format) => Ok(Self { format, input, name, others, is_inside: false }),
            None => {
                Err(CodecErrorKind::UnknownFormat(format!("unpacked from gzip, it is {}", format::unknown(&start))))
            }
        }
    }

    /// Finds the only capture of a zip archive.
    fn only(input: Input, start: &Start) -> Result<Self, CodecErrorKind> {
        let damaged = |reason: String| ImportError::damaged(format!("its zip archive {reason}"));
        let mut archive = Archive::open(input, start.length)
            .map_err(|error| damaged(format!("is damaged: {error}; copy the file again")))?;
        let contents = archive.contents();
        let [name] = contents.captures.as_slice() else {
            return Err(CodecErrorKind::UnknownFormat(not_one(&contents)));
        };
        let bytes = archive.read(name).map_err(|error| damaged(format!("has {}, which {error}", printable(name))))?;
        let (mut input, path) = (Input::of(bytes), PathBuf::from(name));
        let start = Start::of(&mut input, &path)?;
        let format = Format::of(&start).ok_or_else(|| {
            CodecErrorKind::UnknownFormat(format!("its file {} is {}", printable(name), format::unknown(&start)))
        })?;
        Ok(Self { format, input, name: path, others: Box::new(archive.beside(name)), is_inside: true })
    }

    /// Reads the scene, with what it does not show. After an error it can be read again, for instance with further
    /// files of the folder.
    ///
    /// # Errors
    /// A damaged file; options that are invalid or contradict the file.
    pub(super) fn read(&mut self, options: &ReadOptions) -> Result<Imported, CodecErrorKind> {
        if !self.is_inside {
            return self.read_input(options);
        }
        let shown = printable(&self.name.to_string_lossy());
        let read = self.read_input(options);
        let mut imported = read.map_err(|error| ImportError::damaged(format!("its file {shown}: {error}")))?;
        imported.lost.insert(0, format!("It is a zip archive, of which {shown} is shown."));
        Ok(imported)
    }

    /// Reads the scene from its bytes.
    fn read_input(&mut self, options: &ReadOptions) -> Result<Imported, CodecErrorKind> {
        self.input.rewind()?;
        match self.format.read {
            Read::File(read) => read(&mut self.input, &self.name, &*self.others, options),
            Read::Bytes(read) => {
                let bytes = self.input.all()?;
                Ok(read(&Source { bytes: &bytes, beside: &*self.others }, options)?)
            }
            Read::Folder(_) => Err(CodecErrorKind::UnknownFormat(format::unknown_folder())),
        }
    }
}

/// Returns the error about a file of no known format.
fn unknown(start: &Start) -> CodecErrorKind {
    CodecErrorKind::UnknownFormat(looks::stand_in(start).unwrap_or_else(|| format::unknown(start)))
}

/// Returns the message about an archive with another number of captures than one.
fn not_one(contents: &Contents) -> String {
    let listed = |names: &[String]| {
        let shown: Vec<String> = names.iter().take(NAMED).map(|name| printable(name)).collect();
        let more = if names.len() > NAMED { format!(" and {} more", names.len() - NAMED) } else { String::new() };
        format!("{}{more}", shown.join(", "))
    };
    match (&contents.captures[..], &contents.fault, &contents.others[..]) {
        ([], Some(fault), _) => format!("is a zip archive that cannot be unpacked here: {fault}; unpack it first"),
        ([], None, []) => "is a zip archive without files".to_owned(),
        ([], None, others) => format!("is a zip archive without a capture: it has {}", listed(others)),
        (captures, ..) => {
            let names: Vec<String> =
                captures.iter().map(|name| name.rsplit('/').next().unwrap_or_default().to_owned()).collect();
            let remedy = if sequence::is_sequence(&names) {
                "unpack it, and give the folder of the frames, or one of the files"
            } else {
                "unpack it, and give one of them"
            };
            format!("is a zip archive of {} captures ({}): {remedy}", captures.len(), listed(captures))
        }
    }
}
