//! Captures of the player `GaussianSplats3D` (`.ksplat`).
//!
//! In: the bytes of a file: a header, the headers of its sections, then for each section its buckets, which are cubes
//! of space, and its splats, as floats (level of compression 0) or with 16 bits for each number (1; 2 has 8 bits for
//! colors that depend on the direction). Out: [`Imported`].

use super::columns::{Columns, Played, coefficient, logit};
use super::drawable::keep_drawable;
use super::error::ImportError;
use super::imported::Imported;
use super::source::Source;
use crate::codec::looks;
use crate::codec::options::ReadOptions;
use crate::codec::start::Start;
use crate::scene::UpAxis;
use half::f16;

/// Extensions of these files.
pub(crate) const EXTENSIONS: &[&str] = &["ksplat"];
/// Bytes of the header, and of the header of a section.
const HEADER: usize = 4096;
const SECTION: usize = 1024;
/// Bytes of the header that have a meaning; the others are 0.
const USED: usize = 44;
/// Bytes of the center of a bucket.
const BUCKET: usize = 12;
/// Largest absolute coefficient in 8 bits of a file that does not state its limits.
const LIMIT: f32 = 1.5;
/// Half the number of steps over the side of a bucket, of a section that does not state it.
const RANGE: u32 = 32767;
/// Most sections of a file that is recognized without its name.
const SECTIONS: u32 = 1 << 16;

/// How the numbers of a file are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    /// Floats.
    Whole,
    /// Means in 16 bits within their buckets, other numbers as half-precision floats.
    Half,
    /// As `Half`, with coefficients in 8 bits between limits.
    Coded,
}

/// The header of a file.
struct Header {
    level: Level,
    sections: u32,
    /// Limits of coefficients in 8 bits.
    limits: [f32; 2],
}

/// A section: its header and its bytes.
struct Section<'a> {
    level: Level,
    limits: [f32; 2],
    count: usize,
    degree: u32,
    /// Units for each step of a mean, and the code of the center of a bucket.
    step: f32,
    range: f32,
    /// Each bucket that has splats: its center, and how many.
    buckets: Vec<([f32; 3], usize)>,
    splats: &'a [u8],
    /// Bytes of a splat.
    width: usize,
}

/// Returns whether a file that starts so is such a capture: by its header, or by its name unless its bytes contradict.
pub(crate) fn is_of(start: &Start) -> bool {
    let is_named = start.extension == "ksplat" && !start.bytes.is_empty() && !looks::is_other(start);
    is_named || has_header(start)
}

/// Returns whether the first bytes are a header that fits the length of the file.
fn has_header(start: &Start) -> bool {
    let bytes = &start.bytes[..];
    let word = |index: usize| number(bytes, index * 4).unwrap_or(u32::MAX);
    let (most_sections, sections, most, count) = (word(1), word(2), word(3), word(4));
    let headers = HEADER as u64 + SECTION as u64 * u64::from(most_sections);
    bytes.len() == HEADER
        && bytes.starts_with(&[0, 1, 0, 0])
        && (1..=SECTIONS).contains(&most_sections)
        && sections <= most_sections
        && count <= most
        && headers <= start.length
        && short(bytes, 20).is_some_and(|level| level <= 2)
        && bytes[USED..].iter().all(|&byte| byte == 0)
}

/// Reads a capture.
///
/// # Errors
/// A file that is cut or of another version; buckets that do not have all splats; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let file = source.bytes;
    let header = Header::of(file)?;
    let headers = file.get(HEADER..).unwrap_or_default().chunks_exact(SECTION).take(header.sections as usize);
    let mut rest = file.get(HEADER + SECTION * headers.len()..).unwrap_or_default();
    if headers.len() < header.sections as usize {
        return Err(cut());
    }
    let sections = headers.map(|own| Section::of(own, &header, &mut rest)).collect::<Result<Vec<_>, ImportError>>()?;
    let degree = sections.iter().map(|section| section.degree).max().unwrap_or(0);
    // Every splat has at least 24 bytes of the file.
    let mut columns = Columns::with_capacity(sections.iter().map(|section| section.count).sum(), degree);
    sections.iter().for_each(|section| section.append(&mut columns));
    let lost = keep_drawable(&mut columns).into_iter().collect();
    Ok(Imported { scene: columns.into_scene(Played::still(UpAxis::NegY), options)?, lost })
}

fn cut() -> ImportError {
    ImportError::damaged("it is cut: its header states more splats than the file has; copy it again")
}

impl Header {
    /// Reads the header.
    ///
    /// # Errors
    /// Another version or level of compression; a file that is cut.
    fn of(file: &[u8]) -> Result<Self, ImportError> {
        let &[major, minor, ..] = file.get(..HEADER).ok_or_else(cut)? else { return Err(cut()) };
        if major != 0 || minor == 0 {
            return Err(ImportError::unsupported(format!(
                "a .ksplat of version {major}.{minor}, and only versions from 0.1 are known: create it again with the current GaussianSplats3D"
            )));
        }
        let level = match short(file, 20).ok_or_else(cut)? {
            0 => Level::Whole,
            1 => Level::Half,
            2 => Level::Coded,
            other => {
                return Err(ImportError::unsupported(format!(
                    "a .ksplat of the level of compression {other}, and only levels 0 to 2 are known"
                )));
            }
        };
        let limit = |at: usize, default: f32| real(file, at).filter(|limit| limit.is_normal()).unwrap_or(default);
        let sections = number(file, 4).ok_or_else(cut)?;
        Ok(Self { level, sections, limits: [limit(36, -LIMIT), limit(40, LIMIT)] })
    }
}

impl Level {
    /// Returns the bytes of a mean (or scales), of a rotation, and of a coefficient.
    fn widths(self) -> [usize; 3] {
        match self {
            Self::Whole => [12, 16, 4],
            Self::Half => [6, 8, 2],
            Self::Coded => [6, 8, 1],
        }
    }
}

impl<'a> Section<'a> {
    /// Reads a section from its header and the bytes after those of the sections before it.
    ///
    /// # Errors
    /// A section that is cut; a degree that is not known; buckets that do not have all splats.
    fn of(own: &[u8], header: &Header, rest: &mut &'a [u8]) -> Result<Self, ImportError> {
        let word = |index: usize| number(own, index * 4).unwrap_or(0);
        let level = header.level;
        let degree = short(own, 40).unwrap_or(0);
        if degree > 3 {
            return Err(ImportError::damaged(format!("a section has colors of degree {degree}, and 3 is the highest")));
        }
        let coefficients = (usize::from(degree) + 1).pow(2) - 1;
        let [mean, rotation, value] = level.widths();
        let width = 2 * mean + rotation + 4 + coefficients * 3 * value;
        // Only sections with codes of means have buckets.
        let width_of_bucket = short(own, 20).unwrap_or(0);
        let lengths = part(rest, word(9), 4)?;
        let centers = part(rest, word(3), usize::from(width_of_bucket))?;
        let splats = part(rest, word(1), width)?;
        let count = splats.len() / width;
        let range = Some(word(6)).filter(|&range| range > 0).unwrap_or(RANGE) as f32;
        let mut section = Self {
            level,
            limits: header.limits,
            count,
            degree: degree.into(),
            step: real(own, 16).unwrap_or(0.0) / 2.0 / range,
            range,
            buckets: Vec::new(),
            splats,
            width,
        };
        if level == Level::Whole {
            section.buckets.push(([0.0; 3], count));
        } else if usize::from(width_of_bucket) == BUCKET || count == 0 {
            section.buckets = buckets(centers, word(8) as usize, word(2) as usize, lengths, count)?;
        } else {
            return Err(ImportError::damaged(format!(
                "a section has buckets of {width_of_bucket} bytes, not {BUCKET}"
            )));
        }
        Ok(section)
    }

    /// Appends its splats. Coefficients that other sections have and it does not are 0.
    fn append(&self, columns: &mut Columns) {
        let [width, turn, _] = self.level.widths();
        let stride = columns.harmonics.coefficients * 3;
        let mut splats = self.splats.chunks_exact(self.width);
        for (center, count) in &self.buckets {
            for splat in splats.by_ref().take(*count) {
                let color = 2 * width + turn;
                let [red, green, blue, alpha] = [0, 1, 2, 3].map(|at| f32::from(splat[color + at]) / 255.0);
                columns.mean.push([0, 1, 2].map(|axis| self.mean(splat, axis, center[axis])));
                columns.log_scale.push([0, 1, 2].map(|axis| self.value(&splat[width..], axis).ln()));
                columns.rotation.push([0, 1, 2, 3].map(|lane| self.value(&splat[2 * width..], lane)));
                columns.opacity_logit.push(logit(alpha));
                let values = &mut columns.harmonics.values;
                let end = values.len() + stride;
                values.extend([red, green, blue].map(coefficient));
                self.append_rest(&splat[color + 4..], values);
                values.resize(end, 0.0);
            }
        }
    }

    /// Appends the coefficients of degrees 1 and above, which are stored by degree, and in each with red first.
    fn append_rest(&self, stored: &[u8], values: &mut Vec<f32>) {
        for degree in 1..=self.degree as usize {
            let (first, count) = (3 * (degree * degree - 1), 2 * degree + 1);
            let places = (0..count).flat_map(|index| [0, 1, 2].map(|channel| first + channel * count + index));
            values.extend(places.map(|place| self.coefficient(stored, place)));
        }
    }

    /// Returns a coordinate of a mean in a bucket with this center.
    fn mean(&self, splat: &[u8], axis: usize, center: f32) -> f32 {
        match self.level {
            Level::Whole => real(splat, axis * 4).unwrap_or(0.0),
            Level::Half | Level::Coded => {
                let code = short(splat, axis * 2).unwrap_or(0);
                (f32::from(code) - self.range) * self.step + center
            }
        }
    }

    /// Returns a number that is not a mean.
    fn value(&self, stored: &[u8], index: usize) -> f32 {
        match self.level {
            Level::Whole => real(stored, index * 4).unwrap_or(0.0),
            Level::Half | Level::Coded => f16::from_bits(short(stored, index * 2).unwrap_or(0)).to_f32(),
        }
    }

    /// Returns a coefficient.
    fn coefficient(&self, stored: &[u8], index: usize) -> f32 {
        let [least, most] = self.limits;
        match self.level {
            Level::Coded => least + f32::from(stored[index]) / 255.0 * (most - least),
            Level::Whole | Level::Half => self.value(stored, index),
        }
    }
}

/// Returns the center and the number of splats of each bucket of a section: first the full buckets, then the others.
///
/// # Errors
/// Fewer buckets than are stated, or than the splats need.
fn buckets(
    centers: &[u8],
    full: usize,
    size: usize,
    lengths: &[u8],
    count: usize,
) -> Result<Vec<([f32; 3], usize)>, ImportError> {
    let centers = centers.as_chunks::<BUCKET>().0;
    let lengths = lengths.as_chunks::<4>().0;
    if full.checked_add(lengths.len()).is_none_or(|needed| needed > centers.len()) {
        return Err(ImportError::damaged(format!(
            "a section has {} buckets, and states {full} full ones and {} others",
            centers.len(),
            lengths.len()
        )));
    }
    let lengths = lengths.iter().map(|&length| u32::from_le_bytes(length) as usize);
    let sizes = std::iter::repeat_n(size, full).chain(lengths);
    let center = |bytes: &[u8; BUCKET]| [0, 4, 8].map(|at| real(bytes, at).unwrap_or(0.0));
    let buckets: Vec<([f32; 3], usize)> = centers.iter().map(center).zip(sizes).collect();
    let held = buckets.iter().fold(0_usize, |held, &(_, size)| held.saturating_add(size));
    if held < count {
        return Err(ImportError::damaged(format!("the buckets of a section have {held} of its {count} splats")));
    }
    Ok(buckets)
}

/// Takes so many items of this width from the bytes that are left.
///
/// # Errors
/// Fewer bytes.
fn part<'a>(rest: &mut &'a [u8], count: u32, width: usize) -> Result<&'a [u8], ImportError> {
    let length = usize::try_from(count).ok().and_then(|count| count.checked_mul(width)).ok_or_else(cut)?;
    let (taken, after) = rest.split_at_checked(length).ok_or_else(cut)?;
    *rest = after;
    Ok(taken)
}

/// Returns the number of 16 bits at a place.
fn short(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().copied().map(u16::from_le_bytes)
}

/// Returns the number of 32 bits at a place.
fn number(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}

/// Returns the float at a place.
fn real(bytes: &[u8], at: usize) -> Option<f32> {
    bytes.get(at..)?.first_chunk().copied().map(f32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::source::InMemory;
    use crate::scene::{SceneForm, Trained};

    /// The side of a bucket.
    const SIDE: f32 = 4.0;

    /// A section to write.
    struct Made {
        degree: u16,
        /// Buckets: the center, and the numbers of the splats in it.
        buckets: Vec<([f32; 3], Vec<usize>)>,
        /// How many of the buckets are full, with two splats each.
        full: usize,
    }

    /// Returns the place of a splat within its bucket, in 64ths of its side around its center.
    fn offset(number: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| ((number * 7 + axis * 3) % 17) as f32 - 8.0)
    }

    /// Returns a coefficient of degree 1 or above, by its index of those of all degrees.
    fn rest(number: usize, index: usize, channel: usize) -> f32 {
        ((number + index * 5 + channel * 3) % 9) as f32 * 0.25 - 1.0
    }

    fn numbers(values: &[f32], level: u16) -> Vec<u8> {
        let bytes = |&value: &f32| match level {
            0 => value.to_le_bytes().to_vec(),
            _ => f16::from_f32(value).to_le_bytes().to_vec(),
        };
        values.iter().flat_map(bytes).collect()
    }

    /// Returns the bytes of a splat.
    fn splat(number: usize, center: [f32; 3], degree: u16, level: u16) -> Vec<u8> {
        let place = offset(number).map(|steps| steps * SIDE / 64.0);
        // 32767 is the center, and half a side is 32767 steps.
        let code = |place: &f32| ((place / SIDE * 2.0 * 32767.0).round() + 32767.0) as u16;
        let mut bytes: Vec<u8> = match level {
            0 => numbers(&[0, 1, 2].map(|axis| center[axis] + place[axis]), 0),
            _ => place.iter().flat_map(|place| code(place).to_le_bytes()).collect(),
        };
        bytes.extend(numbers(&[0.5, 0.25, 0.125 * (number + 1) as f32], level));
        bytes.extend(numbers(&[0.5, -0.5, 0.5, -0.5], level));
        bytes.extend([255, 0, 51, 200 + number as u8]);
        for degree in 1..=usize::from(degree) {
            for channel in 0..3 {
                for index in degree * degree - 1..(degree + 1) * (degree + 1) - 1 {
                    let value = rest(number, index, channel);
                    match level {
                        // The limits are -2 and 2.
                        2 => bytes.push(((value + 2.0) / 4.0 * 255.0) as u8),
                        _ => bytes.extend(numbers(&[value], level)),
                    }
                }
            }
        }
        bytes
    }

    /// Returns the header and the bytes of a section.
    fn section(made: &Made, level: u16) -> (Vec<u8>, Vec<u8>) {
        let count: usize = made.buckets.iter().map(|(_, splats)| splats.len()).sum();
        let mut header = vec![0; SECTION];
        let mut put = |index: usize, value: u32| header[index * 4..index * 4 + 4].copy_from_slice(&value.to_le_bytes());
        put(0, count as u32);
        put(1, count as u32);
        let partial = &made.buckets[made.full..];
        let mut bytes = Vec::new();
        if level > 0 {
            put(2, 2);
            put(3, made.buckets.len() as u32);
            put(4, SIDE.to_bits());
            put(5, BUCKET as u32);
            put(6, 32767);
            put(8, made.full as u32);
            put(9, partial.len() as u32);
            bytes.extend(partial.iter().flat_map(|(_, splats)| (splats.len() as u32).to_le_bytes()));
            bytes.extend(made.buckets.iter().flat_map(|(center, _)| numbers(center, 0)));
        }
        put(10, made.degree.into());
        for (center, splats) in &made.buckets {
            bytes.extend(splats.iter().flat_map(|&number| splat(number, *center, made.degree, level)));
        }
        put(7, bytes.len() as u32);
        (header, bytes)
    }

    /// Returns a file with these sections.
    fn file(sections: &[Made], level: u16) -> Vec<u8> {
        let sections: Vec<_> = sections.iter().map(|made| section(made, level)).collect();
        let count: u32 = sections.iter().filter_map(|(header, _)| number(header, 0)).sum();
        let mut bytes = vec![0; HEADER];
        bytes[1] = 1;
        let words = [(1, sections.len() as u32), (2, sections.len() as u32), (3, count), (4, count), (5, level.into())];
        let limits = [(9, (-2.0_f32).to_bits()), (10, 2.0_f32.to_bits())];
        for (index, value) in words.into_iter().chain(limits) {
            bytes[index * 4..index * 4 + 4].copy_from_slice(&value.to_le_bytes());
        }
        bytes.extend(sections.iter().flat_map(|(header, _)| header.clone()));
        bytes.extend(sections.iter().flat_map(|(_, bytes)| bytes.clone()));
        bytes
    }

    /// Returns two sections: of degree 2 with a full bucket and two others, and of a lower degree.
    fn sections(lower: u16) -> [Made; 2] {
        let first = vec![([1.0, 2.0, 3.0], vec![0, 1]), ([5.0, 2.0, 3.0], vec![2]), ([1.0, -2.0, 3.0], vec![3])];
        let second = vec![([-8.0, 0.5, 0.0], vec![4, 5, 6])];
        [Made { degree: 2, buckets: first, full: 1 }, Made { degree: lower, buckets: second, full: 0 }]
    }

    fn read_file(bytes: &[u8]) -> Result<Imported, ImportError> {
        read(&Source { bytes, beside: &InMemory::default() }, &ReadOptions::default())
    }

    fn start(bytes: &[u8], extension: &str) -> Start {
        let (first, length) = (bytes[..bytes.len().min(HEADER)].to_vec(), bytes.len() as u64);
        Start { bytes: first, length, extension: extension.to_owned(), ..Start::default() }
    }

    #[test]
    fn every_level_of_compression_has_the_values_of_its_splats() {
        for (level, tolerance, coded) in [(0, 1e-6, 1e-6), (1, SIDE / 65534.0, 1e-3), (2, SIDE / 65534.0, 4.0 / 255.0)]
        {
            let imported = read_file(&file(&sections(1), level)).expect("a whole file");
            assert_eq!(imported.lost, [""; 0], "level {level}: nothing is lost");
            assert_eq!(imported.scene.playback.up, UpAxis::NegY, "as it was trained");
            let SceneForm::Trained(Trained { parameters, harmonics }) = &imported.scene.form else { panic!("at rest") };
            assert_eq!((parameters.len(), harmonics.degree), (7, 2), "level {level}: all splats");
            let near = |found: f32, expected: f32, tolerance: f32, about: &str| {
                assert!((found - expected).abs() <= tolerance, "level {level}: {about}: {found}, not {expected}");
            };
            for made in sections(1) {
                for (center, number) in made.buckets.iter().flat_map(|(c, all)| all.iter().map(move |&n| (*c, n))) {
                    for ((center, offset), &found) in center.iter().zip(offset(number)).zip(&parameters.mean[number]) {
                        near(found, center + offset * SIDE / 64.0, tolerance, "a mean");
                    }
                    let scale = (0.125 * (number + 1) as f32).ln();
                    near(parameters.log_scale[number][2], scale, 1e-3, "a scale");
                    assert_eq!(parameters.rotation_l[number], [0.5, -0.5, 0.5, -0.5], "a rotation w, x, y, z");
                    let opacity = (200 + number) as f32 / 255.0;
                    near(parameters.opacity_logit[number], logit(opacity), 1e-5, "an opacity");
                    let colors = harmonics.of(number);
                    near(colors[0] * 0.282_094_8 + 0.5, 1.0, 1e-5, "red");
                    near(colors[2] * 0.282_094_8 + 0.5, 0.2, 1e-5, "blue");
                    for index in 0..8 {
                        let has = index < (usize::from(made.degree) + 1).pow(2) - 1;
                        for channel in 0..3 {
                            let expected = if has { rest(number, index, channel) } else { 0.0 };
                            near(colors[3 + index * 3 + channel], expected, coded, "a coefficient");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_file_is_recognized_by_its_header_whatever_its_name() {
        for level in 0..3 {
            let bytes = file(&sections(0), level);
            assert!(is_of(&start(&bytes, "bin")) && is_of(&start(&bytes, "ksplat")), "level {level}");
            assert!(!is_of(&start(&bytes[..4200], "bin")), "a file that is shorter than its headers");
        }
        assert!(!is_of(&start(&[0; 9000], "bin")), "zeros");
        assert!(!is_of(&start(b"<html>", "ksplat")), "a page with this name");
    }

    #[test]
    fn limits_that_are_not_stated_are_those_of_the_player() {
        let mut bytes = file(&sections(2), 2);
        bytes[36..44].fill(0);
        let imported = read_file(&bytes).expect("a whole file");
        let SceneForm::Trained(Trained { harmonics, .. }) = &imported.scene.form else { panic!("at rest") };
        // -1 of -2 to 2 is the code 63.
        let expected = -1.5 + 63.0 / 255.0 * 3.0;
        assert!((harmonics.of(0)[3] - expected).abs() < 1e-6, "{} is {expected}", harmonics.of(0)[3]);
    }

    #[test]
    fn damaged_files_are_refused_with_the_fault() {
        let whole = file(&sections(1), 1);
        let changed = |at: usize, value: u32| {
            let mut bytes = whole.clone();
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            bytes
        };
        for (bytes, expected) in [
            (whole[..whole.len() - 1].to_vec(), "it is cut"),
            (whole[..3000].to_vec(), "it is cut"),
            (changed(0, 0x0000_0009), "version 9.0"),
            (changed(20, 7), "level of compression 7"),
            (changed(4, u32::MAX), "it is cut"),
            (changed(HEADER + 4, u32::MAX), "it is cut"),
            (changed(HEADER + 8, 0), "have 2 of its 4 splats"),
            (changed(HEADER + 32, 3), "states 3 full ones"),
            (changed(HEADER + 20, 0), "buckets of 0 bytes"),
            (changed(HEADER + 40, 9), "degree 9"),
        ] {
            let message = read_file(&bytes).expect_err("it is refused").to_string();
            assert!(message.contains(expected), "{expected}: {message}");
        }
    }
}
