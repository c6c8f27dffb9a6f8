//! The beginning of a package: what can be drawn before all of its bytes have been received.
//!
//! In: the first bytes of a package. Out: where its layers end in the file; a smaller package of the layers that are
//! there, whose Gaussians have plain color. The layers of packed Gaussians come before the codes of colors, the
//! codebooks and the temporal filter, which a coarse picture does not need.

use super::attribute::Attribute;
use super::envelope;
use super::error::PackageError;
use super::header::{CHUNKS_FOLLOW, CODEBOOKS_IN_INDEX, Header, StoredForm};
use super::section::Section;
use crate::scene::FilterKind;
use std::io;
use std::ops::Range;

/// A layer is shown only if it ends at most at this part of the file: a later one would hardly be seen.
const LATEST: f64 = 0.9;

/// The layers of a package of which at least the header has been received.
#[derive(Debug, Clone, PartialEq)]
pub struct Beginning {
    header: Header,
    /// Where each section is in the file, with the length before it.
    places: Vec<Range<usize>>,
    /// Numbers of Gaussians up to the end of each layer, and the bytes of the file up to there.
    gaussians: Vec<usize>,
    bytes: Vec<usize>,
}

impl Beginning {
    /// Reads the header of a package from its first bytes. `None`: the header has not been received whole.
    ///
    /// # Errors
    /// Bytes of another format; a damaged header.
    pub fn of(bytes: &[u8]) -> Result<Option<Self>, PackageError> {
        Ok(envelope::read_beginning(bytes)?.map(|(header, start)| Self::of_header(&header, start)))
    }

    /// Returns the layers of a package whose first section starts at `start`. The header must have been checked.
    pub(super) fn of_header(header: &Header, start: u64) -> Self {
        let mut end = usize::try_from(start).unwrap_or(usize::MAX);
        let mut places = Vec::with_capacity(header.sections.len());
        for section in &header.sections {
            let first = end;
            end = end.saturating_add(8).saturating_add(section.length);
            places.push(first..end);
        }
        // The frames of a sequence would be drawn all at once without their filter.
        let is_drawable = matches!(header.form, StoredForm::Packed { .. })
            && header.filter.is_none_or(|filter| filter.kind != FilterKind::Window);
        let (mut gaussians, mut bytes) = (Vec::new(), Vec::new());
        let latest = (end as f64 * LATEST) as usize;
        for count in header.layers.iter().copied().chain([header.gaussians]).filter(|&count| is_drawable && count > 0) {
            let own = needed(header, count);
            let last = own.and_then(|own| own.into_iter().map(|index| places[index].end).max());
            if let Some(last) = last.filter(|&last| last <= latest && bytes.last().is_none_or(|&before| before < last))
            {
                gaussians.push(count);
                bytes.push(last);
            }
        }
        Self { header: header.clone(), places, gaussians, bytes }
    }

    /// Returns the number of bytes after which each layer can be drawn, ascending; empty if nothing can be drawn before
    /// all of the file is there.
    pub fn layers(&self) -> &[usize] {
        &self.bytes
    }

    /// Returns the share of the Gaussians of the package that are in the layers up to this one, above 0 and at most 1;
    /// 1 for a layer that does not exist.
    pub fn share(&self, layer: usize) -> f32 {
        self.gaussians.get(layer).map_or(1.0, |&count| count as f32 / self.header.gaussians.max(1) as f32)
    }

    /// Returns a package of the layers up to this one, from the first bytes of the file. It has no temporal filter, no
    /// environment map, sockets, colliders, sound, chunk files or levels of detail. Its sections are checked when it is
    /// read.
    ///
    /// # Errors
    /// Layers that have not been received whole, or that do not exist; too little memory; a package that a reader would
    /// refuse as a decompression bomb.
    pub fn package(&self, bytes: &[u8], layer: usize) -> Result<Vec<u8>, PackageError> {
        let expected = self.bytes.get(layer).copied().unwrap_or(usize::MAX);
        let truncated = || PackageError::Truncated { expected: expected as u64, found: bytes.len() as u64 };
        let count = *self.gaussians.get(layer).ok_or_else(truncated)?;
        let indices = needed(&self.header, count).ok_or_else(truncated)?;
        let mut header = plain(&self.header, count);
        header.sections = indices.iter().map(|&index| self.header.sections[index].clone()).collect();
        let mut package = Vec::new();
        envelope::write(&mut package, &header)?;
        let bodies = indices.into_iter().map(|index| bytes.get(self.places[index].clone()).ok_or_else(truncated));
        let bodies = bodies.collect::<Result<Vec<_>, _>>()?;
        let room = package.try_reserve_exact(bodies.iter().map(|body| body.len()).sum());
        room.map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        bodies.into_iter().for_each(|body| package.extend_from_slice(body));
        Ok(package)
    }
}

/// Returns the header of the first `count` Gaussians in plain color, without sections.
fn plain(header: &Header, count: usize) -> Header {
    let codebooks = match header.form {
        StoredForm::Packed { codebooks: Some(_) } => Some([0; 4]),
        StoredForm::Packed { codebooks: None } | StoredForm::Trained { .. } | StoredForm::Sliced => None,
    };
    // Layers of chunk files are of descending importance within their stretches of time only.
    let mut layers = if header.runs.is_some() { Vec::new() } else { header.layers.clone() };
    layers.retain(|&end| end < count);
    Header {
        form: StoredForm::Packed { codebooks },
        gaussians: count,
        coefficients: 1,
        degree: 0,
        degree_t: 0,
        environment: None,
        filter: None,
        layers,
        runs: None,
        codebooks_in_index: false,
        levels: Vec::new(),
        sockets: Vec::new(),
        colliders: None,
        sound: None,
        chunks: None,
        chunks_follow: false,
        sections: Vec::new(),
        requires: header
            .requires
            .iter()
            .filter(|name| !["filter", CODEBOOKS_IN_INDEX, CHUNKS_FOLLOW].contains(&name.as_str()))
            .cloned()
            .collect(),
        ..header.clone()
    }
}

/// Returns the indices of the sections that a picture of the first `count` Gaussians in plain color needs; `None` if
/// one of them has further Gaussians.
fn needed(header: &Header, count: usize) -> Option<Vec<usize>> {
    let attributes = plain(header, count).attributes();
    let rows = |section: &Section| {
        let of = |attribute: &&Attribute| attribute.name == section.name;
        attributes.iter().find(of).and_then(|attribute| attribute.rows_of(count))
    };
    let of_section = |(index, section): (usize, &Section)| {
        let rows = rows(section).filter(|&rows| section.first < rows)?;
        Some((section.first.saturating_add(section.count) <= rows).then_some(index))
    };
    header.sections.iter().enumerate().filter_map(of_section).collect()
}
