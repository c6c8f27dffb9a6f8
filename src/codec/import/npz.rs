//! Parameters of Dynamic 3D Gaussians (`params.npz`): Gaussians that are tracked from frame to frame.
//!
//! In: the bytes of a zip archive of arrays. Out: [`Imported`]: each track in straight pieces that end at frames. The
//! unpacked size of the arrays is limited by the [`Budget`] of the archive.

use super::assumed;
use super::columns::{Columns, Played, coefficient};
use super::error::ImportError;
use super::imported::Imported;
use super::in_pieces::{in_pieces, middle_scale, splitting, statements};
use super::source::Source;
use crate::codec::budget::{Budget, UnpackError};
use crate::codec::npy::Array;
use crate::codec::options::{FPS, ReadOptions};
use crate::codec::start::Start;
use crate::gaussian::SMALLEST_CUTOFF;
use crate::scene::pieces::{ALWAYS, Bends, Curve, Piece};
use crate::scene::{MAX_SEGMENTS, UpAxis};
use glam::{DVec3, Vec3, Vec4};
use std::io::Cursor;
use zip::ZipArchive;

/// Extensions of these files.
pub(crate) const EXTENSIONS: &[&str] = &["npz"];
/// The array of the means, by which the format is recognized.
const MEANS: &str = "means3D";
/// The way out if an array unpacks to too much.
const REMEDY: &str = "if it is what it should be, save it uncompressed with numpy.savez";

/// Returns whether a file that starts so has such parameters.
pub(crate) fn is_of(start: &Start) -> bool {
    start.has_entry(&format!("{MEANS}.npy"))
}

/// The arrays of a file.
struct Arrays<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    budget: Budget,
}

impl<'a> Arrays<'a> {
    /// Opens a file.
    ///
    /// # Errors
    /// Bytes that are no archive.
    fn open(bytes: &'a [u8]) -> Result<Self, ImportError> {
        let zip = ZipArchive::new(Cursor::new(bytes))
            .map_err(|error| ImportError::damaged(format!("its zip archive is damaged: {error}")))?;
        Ok(Self { zip, budget: Budget::of(bytes.len() as u64) })
    }

    /// Unpacks an array.
    ///
    /// # Errors
    /// An array that is not there, is damaged, or unpacks to too many bytes.
    fn unpack(&mut self, name: &str) -> Result<Vec<u8>, ImportError> {
        let damaged = |reason: &str| ImportError::damaged(format!("its array {name} {reason}"));
        let entry = self.zip.by_name(&format!("{name}.npy")).map_err(|_| damaged("is missing or damaged"))?;
        let length = entry.size();
        self.budget.unpack_stated(entry, length).map_err(|error| match error {
            UnpackError::OverBudget(over) => damaged(&format!("{over}: {REMEDY}")),
            error => damaged(&error.to_string()),
        })
    }
}

/// An array of floating-point numbers in C order.
struct Floats {
    bytes: Vec<u8>,
    /// Offset of the first value, bytes.
    start: usize,
    is_double: bool,
    shape: Vec<usize>,
}

impl Floats {
    /// Reads an array of the archive.
    ///
    /// # Errors
    /// An array that is not there, is damaged, or has values of another type.
    fn read(arrays: &mut Arrays, name: &str) -> Result<Self, ImportError> {
        let damaged = |reason: &str| ImportError::damaged(format!("its array {name} {reason}"));
        let bytes = arrays.unpack(name)?;
        let array = Array::read(&bytes).ok_or_else(|| damaged("is not a whole array: copy the file again"))?;
        let is_double = match array.kind {
            "<f4" => false,
            "<f8" => true,
            _ => return Err(damaged("has values that are not float32 or float64")),
        };
        if array.is_fortran && array.shape.len() > 1 {
            return Err(damaged("is in Fortran order: save it with numpy.ascontiguousarray"));
        }
        if !array.is_whole(if is_double { 8 } else { 4 }) {
            return Err(damaged("is not as long as its shape: copy the file again"));
        }
        let (start, shape) = (bytes.len() - array.values.len(), array.shape);
        Ok(Self { start, is_double, shape, bytes })
    }

    /// Checks the shape.
    ///
    /// # Errors
    /// Another shape.
    fn require(self, name: &str, shape: &[usize]) -> Result<Self, ImportError> {
        let is_expected = self.shape.iter().product::<usize>() == shape.iter().product::<usize>()
            && self.shape.iter().filter(|&&side| side != 1).eq(shape.iter().filter(|&&side| side != 1));
        if is_expected {
            return Ok(self);
        }
        let reason = format!("its array {name} has the shape {:?}, not {shape:?}", self.shape);
        Err(ImportError::damaged(reason))
    }

    /// Returns the values of a row; 0 outside the array, which the shape excludes.
    fn row<const N: usize>(&self, row: usize) -> [f32; N] {
        std::array::from_fn(|column| {
            let size = if self.is_double { 8 } else { 4 };
            let at = self.start + (row * N + column) * size;
            let bytes = self.bytes.get(at..).unwrap_or(&[]);
            if self.is_double {
                bytes.first_chunk().map_or(0.0, |bytes| f64::from_le_bytes(*bytes) as f32)
            } else {
                bytes.first_chunk().map_or(0.0, |bytes| f32::from_le_bytes(*bytes))
            }
        })
    }
}

/// Reads the parameters.
///
/// # Errors
/// A damaged archive; arrays that are missing or do not fit; Gaussians that cannot be drawn; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let arrays = &mut Arrays::open(source.bytes)?;
    let means = Floats::read(arrays, MEANS)?;
    let [frames, count, 3] = means.shape[..] else {
        let reason = format!("its array {MEANS} has the shape {:?}, not frames x Gaussians x 3", means.shape);
        return Err(ImportError::unsupported(reason));
    };
    if frames == 0 || count == 0 {
        return Err(ImportError::damaged("it has no Gaussians"));
    }
    let segments = u32::try_from(frames.saturating_sub(1).max(1)).unwrap_or(u32::MAX);
    if segments > MAX_SEGMENTS {
        return Err(ImportError::unsupported(format!(
            "it has {frames} frames, and at most {MAX_SEGMENTS} are possible"
        )));
    }
    let rotations = Floats::read(arrays, "unnorm_rotations")?.require("unnorm_rotations", &[frames, count, 4])?;
    let colors = Floats::read(arrays, "rgb_colors")?.require("rgb_colors", &[frames, count, 3])?;
    let opacities = Floats::read(arrays, "logit_opacities")?.require("logit_opacities", &[count, 1])?;
    let scales = Floats::read(arrays, "log_scales")?.require("log_scales", &[count, 3])?;
    let played = Played {
        up: UpAxis::NegY,
        time_interval: [0.0, 1.0],
        duration_seconds: (frames - 1) as f32 / options.fps.unwrap_or(FPS),
        marginal_cutoff: SMALLEST_CUTOFF,
    };
    let splitting = splitting(&played, options, segments, Bends::AtSegments)?;
    let mut whole = Columns::with_capacity(count, 0);
    for index in 0..count {
        whole.log_scale.push(scales.row(index));
        whole.opacity_logit.extend(opacities.row::<1>(index));
        whole.harmonics.values.extend([0.0; 3]);
    }
    let [begin, end] = splitting.interval.map(f64::from);
    let frame = |time: f64| ((time - begin) / (end - begin) * f64::from(segments)).clamp(0.0, (frames - 1) as f64);
    let mean = |frame: usize, index: usize| Vec3::from(means.row(frame * count + index)).as_dvec3();
    let pieces = splitting.split(count, |index| {
        let position = move |time: f64| -> DVec3 {
            let at = frame(time);
            let before = at as usize;
            let after = (before + 1).min(frames - 1);
            mean(before, index).lerp(mean(after, index), at.fract())
        };
        let scale = middle_scale(whole.log_scale[index]);
        Curve { position, mean_t: 0.0, sigma_t: f32::INFINITY, window: ALWAYS, scale }
    });
    let row = |piece: &Piece, time: f32| frame(f64::from(time)).round() as usize * count + piece.source as usize;
    let rotation = |piece: &Piece, time: f32| Vec4::from(rotations.row(row(piece, time))).normalize_or(Vec4::X);
    let color = |piece: &Piece, time: f32| colors.row::<3>(row(piece, time)).map(coefficient);
    let turned = |piece: &Piece| {
        let [middle, first] = [piece.middle(), piece.times[0]].map(|time| rotation(piece, time));
        2.0 * middle.dot(first).abs().min(1.0).acos()
    };
    let angle = pieces.pieces.iter().map(turned).fold(0.0, f32::max).to_degrees();
    let mut lost = statements(&pieces, count, splitting.tolerance);
    if frames > 1 {
        lost.extend(assumed::speed(frames, options));
    }
    lost.push(format!(
        "Rotation and color of a piece are constant: those of its middle frame. The rotation is at most {angle:.1} degrees from that at its \
         beginning."
    ));
    let values = pieces.pieces.iter().flat_map(|piece| color(piece, piece.middle())).collect();
    let sigmas = vec![f32::INFINITY; count];
    let mut columns = in_pieces(&whole, &sigmas, pieces, |piece| rotation(piece, piece.middle()).to_array());
    columns.harmonics.values = values;
    Ok(Imported { scene: columns.into_scene(played, options)?, lost })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::source::InMemory;
    use crate::codec::import::testing::gaussians;
    use crate::codec::npy::tests::npy;
    use std::io::Write;
    use zip::write::SimpleFileOptions;

    const FRAMES: usize = 11;

    /// Returns an array of single or double precision.
    fn array(shape: &str, values: &[f32], is_double: bool) -> Vec<u8> {
        let kind = if is_double { "<f8" } else { "<f4" };
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}\n");
        let bytes: Vec<u8> = match is_double {
            true => values.iter().flat_map(|&value| f64::from(value).to_le_bytes()).collect(),
            false => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        };
        npy(&header, &bytes)
    }

    /// Returns the arrays of two Gaussians: one moves along a straight line, one turns back in the middle.
    fn arrays(is_double: bool) -> Vec<(&'static str, Vec<u8>)> {
        let mut means = Vec::new();
        for frame in 0..FRAMES {
            let time = frame as f32;
            means.extend([time, 0.0, 1.0, 0.0, (time - 5.0).abs(), 2.0]);
        }
        let rotations = [2.0, 0.0, 0.0, 0.0].repeat(2 * FRAMES);
        vec![
            ("means3D", array("11, 2, 3", &means, is_double)),
            ("unnorm_rotations", array("11, 2, 4", &rotations, is_double)),
            ("rgb_colors", array("11, 2, 3", &[0.75; 6 * FRAMES], is_double)),
            ("logit_opacities", array("2, 1", &[1.0, 2.0], is_double)),
            ("log_scales", array("2, 3", &[-2.0; 6], is_double)),
            ("seg_colors", array("2, 3", &[1.0; 6], is_double)),
        ]
    }

    fn file(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in arrays {
            let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
            zip.start_file(format!("{name}.npy"), options).expect("an entry");
            zip.write_all(bytes).expect("its bytes");
        }
        zip.finish().expect("an archive").into_inner()
    }

    fn read_file(bytes: &[u8]) -> Result<Imported, ImportError> {
        let source = Source { bytes, beside: &InMemory::default() };
        read(&source, &ReadOptions::default())
    }

    #[test]
    fn tracks_are_split_only_where_they_turn() {
        for is_double in [false, true] {
            let found = read_file(&file(&arrays(is_double))).expect("whole parameters");
            let filter = found.scene.filter.as_ref().expect("pieces have a filter");
            let all = gaussians(&found);
            assert_eq!(all.len(), 3, "one piece and two");
            assert!((found.scene.playback.duration_seconds - 10.0 / 30.0).abs() < 1e-6, "ten steps of 1/30 s");
            let is_stated = found.lost.iter().any(|sentence| sentence.contains("11 frames are played at 30 a second"));
            assert!(is_stated, "the speed that is assumed: {:?}", found.lost);
            for frame in 0..FRAMES {
                let time = frame as f32 / 10.0;
                let segment = filter.segment_of(time, [0.0, 1.0]);
                let active: Vec<usize> = (0..3).filter(|&index| filter.is_active(segment, index)).collect();
                assert_eq!(active.len(), 2, "at frame {frame} each Gaussian has one piece");
                let expected = [Vec3::new(frame as f32, 0.0, 1.0), Vec3::new(0.0, (frame as f32 - 5.0).abs(), 2.0)];
                for (&index, expected) in active.iter().zip(expected) {
                    let at = all[index].mean_at(time);
                    assert!(at.distance(expected) < 1e-4, "frame {frame}: {at} is {expected}");
                }
            }
        }
    }

    #[test]
    fn arrays_that_do_not_fit_are_refused() {
        for name in ["means3D", "unnorm_rotations", "rgb_colors", "logit_opacities", "log_scales"] {
            let mut without = arrays(false);
            without.retain(|(other, _)| *other != name);
            let error = read_file(&file(&without)).expect_err("an array is missing").to_string();
            assert!(error.contains(name), "{error} names {name}");
            let mut other = arrays(false);
            for (_, bytes) in other.iter_mut().filter(|(other, _)| *other == name) {
                *bytes = array("7, 5", &[0.0; 35], false);
            }
            let error = read_file(&file(&other)).expect_err("another shape").to_string();
            assert!(error.contains(name), "{error} names {name}");
        }
        let whole = file(&arrays(false));
        for length in (0..whole.len()).step_by(11) {
            assert!(read_file(&whole[..length]).is_err(), "cut at {length} bytes");
        }
    }

    #[test]
    fn an_array_that_would_fill_the_memory_is_refused_before_it_is_unpacked() {
        let array = array("1000, 20000, 3", &[0.0; 777], false);
        let (length, claim) = ((array.len() as u32).to_le_bytes(), 240_000_080_u32);
        let mut bytes = file(&[("means3D", array)]);
        let places: Vec<usize> = (0..bytes.len() - 4).filter(|&at| bytes[at..at + 4] == length).collect();
        assert_eq!(places.len(), 2, "the length stands before the entry and in the directory");
        for at in places {
            bytes[at..at + 4].copy_from_slice(&claim.to_le_bytes());
        }
        let limit = (128 << 20) + 64 * bytes.len();
        let error = read_file(&bytes).expect_err("more than the limit").to_string();
        let parts = ["means3D".to_owned(), claim.to_string(), limit.to_string(), "numpy.savez".to_owned()];
        assert!(parts.iter().all(|part| error.contains(part)), "array, claim, limit, and the way out: {error}");
    }
}
