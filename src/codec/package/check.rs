//! The checks of a header: against itself, the length of the file, and a scene.
//!
//! In: a [`Header`]. Out: a [`PackageError`] unless its numbers fit together, so that later code can allocate by them.

use super::attribute::Attribute;
use super::colliders::{ColliderWords, StoredColliders};
use super::error::PackageError;
use super::header::{Header, LEVEL, StoredForm};
use super::layout;
use super::section::{FLOAT_PLANES, PACKAGE, Section};
use crate::gaussian::SMALLEST_CUTOFF;
use crate::gaussian::harmonics::{MAX_COEFFICIENTS, evaluated};
use crate::scene::detail::check_sizes;
use crate::scene::packed::{MAX_ENTRIES, are_layers};
use crate::scene::{
    ChunkFile, ChunkTable, GaussianScene, MAX_LEVELS, MAX_SEGMENTS, SceneForm, SoundFile, Trained, check_sockets,
};

/// Uncompressed bytes that a package of any length may hold.
const RAW_FLOOR: u64 = 64 << 20;

/// Further uncompressed bytes allowed for each byte of the file. Trained captures need 1.2.
const RAW_PER_BYTE: u64 = 256;

/// Largest number of sections that is read. The writer makes fewer for a hundred million Gaussians.
const MAX_SECTIONS: usize = 1 << 16;

impl Header {
    /// Checks that a scene whose header this is can be written: valid numbers, and parts that fit together. `colliders`
    /// are the words of its colliders.
    pub(super) fn check_writable(&self, scene: &GaussianScene, colliders: &ColliderWords) -> Result<(), PackageError> {
        self.check_numbers()?;
        self.check_scene(scene, colliders)?;
        scene.check().map_err(PackageError::Inconsistent)
    }

    /// Checks that the sections, from `start` on, with the chunk files that follow fill a file of `file_length` bytes
    /// and hold every attribute once, and that all numbers are valid. Afterwards the sizes of
    /// [`attributes`](Self::attributes) can be allocated.
    pub(super) fn check(&self, start: u64, file_length: u64) -> Result<(), PackageError> {
        let expected = self.length(start);
        if expected > file_length {
            return Err(PackageError::Truncated { expected, found: file_length });
        }
        if expected < file_length {
            return Err(PackageError::TrailingBytes { count: file_length - expected });
        }
        let found = self.sections.len();
        if found > MAX_SECTIONS {
            return Err(PackageError::TooManySections { found, limit: MAX_SECTIONS });
        }
        self.check_numbers()?;
        let attributes = self.attributes();
        // Chunk files are read by themselves.
        let limit = unpacked_limit(self.end(start));
        let within = |raw: u64| if raw > limit { Err(PackageError::TooLarge { raw, limit }) } else { Ok(()) };
        within(self.scene_memory(&attributes))?;
        attributes.iter().try_for_each(|attribute| check_sections(attribute, &self.sections))?;
        within(self.unpacked())?;
        self.check_level_sections()
    }

    /// Returns the bytes that reading takes, without levels of detail. The sections must have been checked.
    pub(super) fn unpacked(&self) -> u64 {
        let attributes = self.attributes();
        // In addition to the scene, one section at a time is decompressed.
        let decoded = self.sections.iter().filter(|s| attributes.iter().any(|attribute| attribute.name == s.name));
        let largest = decoded.map(|section| section.raw_length as u64).max().unwrap_or_default();
        self.scene_memory(&attributes).saturating_add(largest)
    }

    /// Returns the bytes of the tables of all attributes, and of the colliders, which are decoded from theirs.
    fn scene_memory(&self, attributes: &[Attribute]) -> u64 {
        let colliders = self.colliders.as_ref().map(StoredColliders::memory).unwrap_or_default();
        attributes.iter().fold(colliders, |sum, attribute| sum.saturating_add(attribute.memory()))
    }

    /// Checks that it is the header of a chunk file as the table of its index says.
    pub(super) fn check_chunk(&self, file: &ChunkFile) -> Result<(), PackageError> {
        if !self.levels.is_empty() || self.chunks.is_some() {
            return Err(PackageError::Inconsistent("a chunk file that has levels of detail, or chunk files itself"));
        }
        if self.gaussians as u64 != file.gaussians {
            return Err(PackageError::Inconsistent("a chunk file of another number of Gaussians than in the table"));
        }
        Ok(())
    }

    /// Checks that each level of detail has its section, in order.
    fn check_level_sections(&self) -> Result<(), PackageError> {
        let mut next = 0;
        for section in self.sections.iter().filter(|section| section.name == LEVEL) {
            let name = section.name.clone();
            if section.encoding != PACKAGE {
                return Err(PackageError::UnknownEncoding { name, encoding: section.encoding.clone() });
            }
            if section.first != next || section.count != 1 || next == self.levels.len() {
                let (found, count) = (section.first, section.count);
                return Err(PackageError::SectionRange { name, found, count, expected: next });
            }
            if section.raw_length != section.length {
                let (expected, found) = (section.length as u64, section.raw_length as u64);
                return Err(PackageError::SectionLength { name, expected, found });
            }
            next += 1;
        }
        match next < self.levels.len() {
            true => Err(PackageError::MissingSection { name: LEVEL.to_owned() }),
            false => Ok(()),
        }
    }

    /// Checks the numbers, without the sections.
    fn check_numbers(&self) -> Result<(), PackageError> {
        let trained = &self.trained_with;
        let [first, last] = trained.time_interval;
        let sane = |condition: bool, otherwise: &'static str| {
            if condition { Ok(()) } else { Err(PackageError::Inconsistent(otherwise)) }
        };
        self.check_color()?;
        sane(
            self.environment.is_none_or(|e| e.width.checked_mul(e.height).is_some_and(|texels| texels > 0)),
            "an environment map with no texels, or far too many",
        )?;
        sane(
            first.is_finite() && first < last && (last - first).is_finite(),
            "the time interval must be two finite numbers, the first below the second, and not infinitely far apart",
        )?;
        sane(trained.background.iter().all(|c| c.is_finite()), "a background color that is not finite")?;
        sane(
            trained.prefilter_var.is_finite() && trained.spatial_lr_scale.is_finite(),
            "a training setting (prefilter_var or spatial_lr_scale) that is not finite",
        )?;
        sane(
            (SMALLEST_CUTOFF..1.0).contains(&trained.marginal_cutoff),
            "a cut-off of the marginal that is not from 1/255 to below 1",
        )?;
        sane(
            trained.color_period.is_none_or(|period| period.is_finite() && period > 0.0),
            "a period of colors that is not positive and finite",
        )?;
        sane(trained.near.is_finite() && trained.near > 0.0, "a near limit that is not positive and finite")?;
        sane(
            trained.pixel.is_none_or(|pixel| pixel.is_finite() && pixel > 0.0),
            "a size of the training views' pixels that is not positive and finite",
        )?;
        sane(trained.spatial_lr_scale >= 0.0, "a training setting (spatial_lr_scale) that is negative")?;
        sane(
            self.filter.is_none_or(|filter| (1..=MAX_SEGMENTS).contains(&filter.segments)),
            "a temporal filter of no segments, or far too many",
        )?;
        let is_packed = matches!(self.form, StoredForm::Packed { .. });
        sane(
            self.layers.is_empty() || (is_packed && are_layers(&self.layers, self.gaussians)),
            "layers that are not ascending numbers of whole blocks of packed Gaussians, or too many",
        )?;
        if let Some(runs) = &self.runs {
            runs.check(self.gaussians).map_err(PackageError::Inconsistent)?;
            sane(
                is_packed && runs.layers() == self.layers,
                "runs of Gaussians that are not packed, or of other layers",
            )?;
        }
        sane(
            !self.codebooks_in_index || self.form.has_codebooks(),
            "a chunk file that has no codebooks and says that they are in its index",
        )?;
        sane(self.levels.len() <= MAX_LEVELS, "more levels of detail than a capture may have")?;
        check_sizes(self.levels.iter().map(|level| level.pixels)).map_err(PackageError::Inconsistent)?;
        check_sockets(&self.sockets).map_err(PackageError::Inconsistent)?;
        self.colliders.as_ref().map_or(Ok(()), StoredColliders::check).map_err(PackageError::Inconsistent)?;
        self.sound.map_or(Ok(()), SoundFile::check_length).map_err(PackageError::Inconsistent)?;
        self.chunks.as_ref().map_or(Ok(()), ChunkTable::check).map_err(PackageError::Inconsistent)?;
        sane(
            self.chunks.is_none() || (self.gaussians == 0 && self.levels.is_empty()),
            "the index of a capture in chunk files with Gaussians or levels of detail itself",
        )?;
        sane(
            !self.chunks_follow || self.chunks.is_some(),
            "chunk files that follow a package without a table of them",
        )?;
        sane(!self.chunks_follow || self.sound.is_none(), "a sound in the index of chunk files that follow it")?;
        let duration = self.playback.duration_seconds;
        sane(duration.is_finite() && duration >= 0.0, "the playback duration must be a finite number, zero or above")
    }

    /// Checks the numbers of color: valid degrees, and enough coefficients for them; in codebooks not more than enough.
    fn check_color(&self) -> Result<(), PackageError> {
        let (found, degree, degree_t) = (self.coefficients, self.degree, self.degree_t);
        if degree > 3 || degree_t > 2 || found > MAX_COEFFICIENTS {
            return Err(PackageError::Inconsistent(
                "color must have a degree of 0 to 3, a time degree of 0 to 2 and at most 48 coefficients",
            ));
        }
        let needed = evaluated(degree, degree_t);
        let refused = |section| Err(PackageError::Coefficients { section, found, needed, degree, degree_t });
        match self.form {
            StoredForm::Packed { codebooks: Some(entries) } => {
                if entries.iter().any(|&entries| entries > MAX_ENTRIES) {
                    return Err(PackageError::Inconsistent("section `codebooks` has more entries than 16-bit codes"));
                }
                if found == needed { Ok(()) } else { refused("codebooks") }
            }
            StoredForm::Trained { .. } | StoredForm::Sliced | StoredForm::Packed { codebooks: None } => {
                if found >= needed { Ok(()) } else { refused(if found == 0 { "sh_dc" } else { "sh_rest" }) }
            }
        }
    }

    /// Checks that the scene and the words of its colliders have exactly the values that these numbers require.
    pub(super) fn check_scene(&self, scene: &GaussianScene, colliders: &ColliderWords) -> Result<(), PackageError> {
        let fits = |a: &Attribute| a.rows.checked_mul(a.stride) == Some(layout::words(scene, colliders, a.name).len());
        if !self.attributes().iter().all(fits) {
            return Err(PackageError::Inconsistent("the attributes of the scene differ in length"));
        }
        match &scene.form {
            SceneForm::Trained(Trained { parameters: p, .. })
                if p.mean_t.is_empty() && !(p.log_scale_t.is_empty() && p.rotation_r.is_empty()) =>
            {
                Err(PackageError::Inconsistent("the scene has attributes of a 4D model but no temporal means"))
            }
            SceneForm::Trained(_) | SceneForm::Ready(_) => Ok(()),
        }
    }
}

/// Checks that the sections of an attribute hold every row once, in order.
fn check_sections(attribute: &Attribute, sections: &[Section]) -> Result<(), PackageError> {
    let mut next = 0;
    for section in sections.iter().filter(|section| section.name == attribute.name) {
        let name = section.name.clone();
        if section.encoding != FLOAT_PLANES {
            return Err(PackageError::UnknownEncoding { name, encoding: section.encoding.clone() });
        }
        if section.first != next || section.count > attribute.rows - next {
            let (found, count) = (section.first, section.count);
            return Err(PackageError::SectionRange { name, found, count, expected: next });
        }
        let (expected, found) = (attribute.raw_length(section.count), section.raw_length as u64);
        if expected != found {
            return Err(PackageError::SectionLength { name, expected, found });
        }
        next += section.count;
    }
    if next < attribute.rows {
        return Err(PackageError::MissingSection { name: attribute.name.to_owned() });
    }
    Ok(())
}

/// Returns the bytes that a package of this length may take when it is read.
pub(super) fn unpacked_limit(file_length: u64) -> u64 {
    RAW_PER_BYTE.saturating_mul(file_length).saturating_add(RAW_FLOOR).min(isize::MAX as u64)
}
