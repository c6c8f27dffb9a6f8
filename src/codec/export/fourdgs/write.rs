//! Writing `.4dgs` files.
//!
//! In: moving Gaussians, with the temporal filter of the capture if it has one. Out: the bytes of a file, and a
//! sentence for each thing that it does not hold or rounds.
//!
//! The file is put together here, of records of the crate `fourdgs`: its own writer has three profiles of precision, of
//! which none keeps the pictures of large splats, and refuses its own rounding at the bounds of a profile.

use super::chunks::{Chunk, chunks};
use super::coder::Coder;
use super::colors::Colors;
use super::deviation::Deviation;
use super::rows::{Row, rows};
use super::steps::{REACH, Times};
use crate::codec::export::clip::Clip;
use crate::codec::export::error::ExportError;
use crate::codec::import::columns::Columns;
use crate::codec::import::fourdgs::exact::{self, LEVEL};
use crate::codec::import::fourdgs::memory;
use crate::scene::UpAxis;
use fourdgs::codec::DEFLATE;
use fourdgs::opcode::SH_BAND_STREAM;
use fourdgs::quantization::morton_order;
use fourdgs::records::{self, ChunkIndexEntry, CoordinateFrame, Footer, Header, Quantization, WindowTable};
use fourdgs::serialization::{MAGIC, crc32, put_record};
use fourdgs::stream::encode_stream;

/// Encodes a file, and returns a sentence for each thing that it does not hold or rounds.
///
/// # Errors
/// Gaussians whose active segments are not contiguous; numbers that are not finite.
pub(crate) fn encode(columns: &Columns, clip: &Clip) -> Result<(Vec<u8>, Vec<String>), ExportError> {
    // The times of a file are seconds from its beginning.
    let duration = f64::from(if clip.duration_seconds > 0.0 { clip.duration_seconds } else { 1.0 });
    let rows = rows(columns, clip, duration)?;
    let times = Times { duration, cutoff: f64::from(clip.marginal_cutoff) };
    let file = File { coder: Coder::of(&rows, times), colors: Colors::of(&columns.harmonics), rows: &rows };
    let encoded = file.encode(clip.up).and_then(|(bytes, order)| {
        let deviation = Deviation::of(&bytes, &file.coder, &rows, &order)?;
        Ok((bytes, deviation))
    });
    let (bytes, deviation) = encoded.map_err(|error| ExportError::Unsupported(error.to_string()))?;
    let mut lost = vec![deviation.sentence()];
    lost.extend(file.other_players());
    lost.extend(memory::too_large(rows.len(), file.colors.coefficients));
    Ok((bytes, lost))
}

/// The contents of a file.
struct File<'r> {
    coder: Coder,
    colors: Colors,
    rows: &'r [Row],
}

impl File<'_> {
    /// Returns the bytes of the file, and the index of the Gaussian at each place in it.
    fn encode(&self, up: UpAxis) -> fourdgs::Result<(Vec<u8>, Vec<usize>)> {
        let mut bytes = self.head(up);
        let (mut index, mut order) = (Vec::new(), Vec::new());
        for chunk in chunks(&self.lives(), &self.bounds()) {
            let members = self.in_morton_order(&chunk.members);
            index.push(self.append_chunk(&mut bytes, &chunk, &members)?);
            order.extend(members);
        }
        bytes.extend(self.exact_record(&order)?.unwrap_or_default());
        let summary = bytes.len();
        for entry in index {
            bytes.extend(entry.encode());
        }
        let has_summary = bytes.len() > summary;
        let footer = Footer {
            summary_start: if has_summary { summary as u64 } else { 0 },
            summary_offset_start: 0,
            summary_crc: if has_summary { crc32(&bytes[summary..]) } else { 0 },
        };
        bytes.extend(footer.encode());
        bytes.extend(MAGIC);
        Ok((bytes, order))
    }

    /// Returns the records before the chunks.
    fn head(&self, up: UpAxis) -> Vec<u8> {
        let Coder { steps, origin, windows, times } = &self.coder;
        let largest = |axis: usize| self.rows.iter().map(|row| row.mean[axis]).reduce(f64::max).unwrap_or_default();
        let header = Header {
            library: concat!("bevy_gs4d ", env!("CARGO_PKG_VERSION")).to_owned(),
            duration_sec: times.duration,
            gaussian_count: self.rows.len() as u64,
            cutoff: times.cutoff,
            aabb: origin.iter().copied().chain([0, 1, 2].map(largest)).collect(),
            sh_degree: self.colors.degree,
            ..Header::default()
        };
        let quantization = Quantization {
            scheme: "uniform-v1".to_owned(),
            pos_origin: origin.to_vec(),
            step_pos: steps.pos,
            step_scale_log: steps.scale_log,
            step_rot: steps.rot,
            step_rgb: steps.rgb,
            step_alpha: steps.alpha,
            step_motion: steps.motion,
            step_time: steps.time,
            step_sigma_log: steps.sigma_log,
            step_sh: steps.sh,
            bounds: self.coder.bounds(self.rows),
            sh_bit_depths: Vec::new(),
        };
        let windows = WindowTable { windows: windows.clone() };
        [MAGIC.to_vec(), header.encode(&[]), quantization.encode(&[]), windows.encode(), frame(up).encode(&[])].concat()
    }

    /// Writes a chunk with the bands of its colors, and returns their offsets.
    fn append_chunk(&self, bytes: &mut Vec<u8>, chunk: &Chunk, members: &[usize]) -> fourdgs::Result<ChunkIndexEntry> {
        let Chunk { times: [t0, t1], level, .. } = *chunk;
        let streams = self.coder.streams(members.iter().map(|&index| &self.rows[index]))?;
        let chunk_offset = bytes.len() as u64;
        bytes.extend(records::encode_chunk(t0, t1, level, members.len() as u32, &streams));
        let chunk_length = bytes.len() as u64 - chunk_offset;
        let mut bands = Vec::new();
        for band in 1..=self.colors.degree {
            let values: Vec<i64> = members.iter().flat_map(|&index| self.colors.band(index, band)).collect();
            let channels = values.len() / members.len().max(1);
            let stream = encode_stream(SH_BAND_STREAM, &values, channels, DEFLATE, LEVEL, true)?;
            let offset = bytes.len() as u64;
            put_record(bytes, SH_BAND_STREAM, &[&[band][..], &stream].concat());
            bands.push((band, offset, bytes.len() as u64 - offset));
        }
        let gaussian_count = members.len() as u32;
        Ok(ChunkIndexEntry { t0, t1, chunk_offset, chunk_length, gaussian_count, bands, ..ChunkIndexEntry::default() })
    }

    /// Returns the record of this program.
    fn exact_record(&self, order: &[usize]) -> fourdgs::Result<Option<Vec<u8>>> {
        let colors: Vec<i64> = order.iter().flat_map(|&index| self.color_residuals(&self.rows[index])).collect();
        let coefficients = order.iter().flat_map(|&index| self.colors.residuals(index));
        let coefficients: Vec<i64> = coefficients.map(|&residual| i64::from(residual)).collect();
        exact::record(&colors, &coefficients, self.colors.coefficients * 3)
    }

    /// Returns the residuals of the color of degree 0, in multiples of [`exact::COLOR`].
    fn color_residuals(&self, row: &Row) -> [i64; 3] {
        let decoded = self.coder.color(row);
        [0, 1, 2]
            .map(|channel| ((row.color[channel] - decoded[channel]) / exact::COLOR).round().clamp(-REACH, REACH) as i64)
    }

    /// Returns the Gaussians of a chunk in Morton order, in which neighbors are near in space.
    fn in_morton_order(&self, members: &[usize]) -> Vec<usize> {
        let means: Vec<f32> =
            members.iter().flat_map(|&index| self.rows[index].mean).map(|coordinate| coordinate as f32).collect();
        morton_order(&means, members.len()).into_iter().map(|place| members[place]).collect()
    }

    /// Returns the first and the last time, in seconds, at which each Gaussian may be visible.
    fn lives(&self) -> Vec<[f64; 2]> {
        self.rows.iter().map(|row| self.coder.life(row)).collect()
    }

    /// Returns the times at which windows begin or end, from the first to the last of the duration.
    fn bounds(&self) -> Vec<f64> {
        let duration = self.coder.times.duration;
        let ends = self.coder.windows.iter().flat_map(|&(opens, closes)| [opens, closes]);
        let mut bounds: Vec<f64> = ends.filter(|&time| time > 0.0 && time < duration).chain([0.0, duration]).collect();
        bounds.sort_unstable_by(f64::total_cmp);
        bounds.dedup();
        bounds
    }

    /// Returns a sentence for each thing that other players do not show.
    fn other_players(&self) -> Vec<String> {
        let beyond = |row: &Row| row.color.iter().fold(0.0_f64, |most, &color| most.max(color - 1.0).max(-color));
        let (mut count, mut farthest) = (0, 0.0_f64);
        for beyond in self.rows.iter().map(beyond).filter(|&beyond| beyond > exact::COLOR) {
            (count, farthest) = (count + 1, farthest.max(beyond));
        }
        let mut lost = Vec::new();
        if count > 0 {
            lost.push(format!(
                "The colors of {count} Gaussians are outside 0 to 1, by up to {farthest:.2}: players other than gs4d clamp them."
            ));
        }
        if self.colors.degree > 0 {
            lost.push(format!(
                "Players other than gs4d round view-dependent color to 256 values for each coefficient, which differ by at most {:.3}.",
                self.colors.worst
            ));
        }
        lost
    }
}

/// Returns the frame of the coordinates, which says what points up; right-handed, in no unit of length.
fn frame(up: UpAxis) -> CoordinateFrame {
    // The axes of the format: +x, +y, +z, -x, -y, -z.
    let (up_axis, forward_axis) = match up {
        UpAxis::PosX => (0, 5),
        UpAxis::PosY => (1, 5),
        UpAxis::PosZ => (2, 1),
        UpAxis::NegX => (3, 5),
        UpAxis::NegY => (4, 2),
        UpAxis::NegZ => (5, 1),
    };
    CoordinateFrame { handedness: 1, up_axis, forward_axis, ..CoordinateFrame::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::Imported;
    use crate::codec::import::columns::{Motion, logit};
    use crate::codec::import::fourdgs::read;
    use crate::codec::import::source::{InMemory, Source};
    use crate::codec::options::ReadOptions;
    use crate::scene::{ActiveSets, FilterKind, Form, SceneForm, Sliced, TemporalFilter};

    /// Returns this many Gaussians of view-dependent color that move during two units of time.
    fn columns(count: u8) -> Columns {
        let mut columns = Columns::with_capacity(count.into(), 1);
        for index in 0..count {
            let x = f32::from(index);
            columns.mean.push([x, 0.5, -0.25]);
            columns.log_scale.push([-3.0, -2.0, -4.0]);
            columns.rotation.push([2.0, 0.1 * x, -0.7, 0.3]);
            columns.opacity_logit.push(logit(0.75));
            columns.harmonics.values.extend((0..12).map(|value| (value as f32 - 6.0) * 0.1));
            columns.motion.push(Motion { velocity: [0.25, 0.0, x], mean_t: 2.0, sigma_t: 0.5 + x });
        }
        columns
    }

    fn clip() -> Clip {
        Clip { time_interval: [1.0, 3.0], duration_seconds: 4.0, fps: 30.0, up: UpAxis::NegZ, marginal_cutoff: 0.05 }
    }

    /// Returns the sentences of the export, and the scene that is read from the file.
    fn again(columns: &Columns) -> (Vec<String>, Imported) {
        let (bytes, lost) = encode(columns, &clip()).expect("Gaussians that can be written");
        let source = Source { bytes: &bytes, beside: &InMemory::default() };
        (lost, read(&source, &ReadOptions::default()).expect("a whole file"))
    }

    fn sliced(found: &Imported) -> &Sliced {
        let SceneForm::Ready(Form::Sliced(sliced)) = &found.scene.form else { panic!("sliced") };
        sliced
    }

    fn near(a: f32, b: f32) -> bool {
        (a - b).abs() < 1e-4
    }

    #[test]
    fn a_written_file_is_read_as_the_same_gaussians() {
        let mut columns = columns(2);
        let sets = ActiveSets::Intervals(vec![1 << 16, 2 | 3 << 16]);
        columns.filter = Some(TemporalFilter { kind: FilterKind::Window, segments: 4, count: 2, sets });
        let (_, found) = again(&columns);
        assert_eq!(found.scene.playback.up, UpAxis::NegZ, "the axis that points up");
        let (sliced, filter) = (sliced(&found), found.scene.filter.as_ref().expect("windows"));
        for step in 0..20 {
            let seconds = 0.1 + step as f32 * 0.2;
            let segment = filter.segment_of(seconds, [0.0, 4.0]);
            let active: Vec<usize> =
                (0..sliced.gaussians.len()).filter(|&index| filter.is_active(segment, index)).collect();
            let [index] = active[..] else { panic!("one is active at {seconds}: {active:?}") };
            let (gaussian, x) = (&sliced.gaussians[index], if seconds < 2.0 { 0.0 } else { 1.0 });
            let (at, time) = (gaussian.mean_at(seconds), 1.0 + seconds / 2.0);
            let is_right = near(at.x, x + 0.25 * (time - 2.0)) && near(at.z, -0.25 + x * (time - 2.0));
            assert!(is_right, "at {seconds} its mean is {at}");
            assert!(near(gaussian.sigma_t, (0.5 + x) * 2.0) && near(gaussian.opacity, 0.75), "lifespan and opacity");
        }
    }

    #[test]
    fn colors_beyond_the_format_come_back_and_are_stated() {
        let mut columns = columns(3);
        // A color of 1.9 in red, one of -0.2 in green; coefficients between two bytes, and beyond their range.
        columns.harmonics.values[0] = 1.4 / crate::codec::import::columns::SH_C0;
        columns.harmonics.values[13] = -0.7 / crate::codec::import::columns::SH_C0;
        columns.harmonics.values[3] = 0.0;
        columns.harmonics.values[4] = 4.5;
        let (lost, found) = again(&columns);
        let found = &sliced(&found).harmonics;
        for (at, (&found, &expected)) in found.values.iter().zip(&columns.harmonics.values).enumerate() {
            assert!((found - expected).abs() < 0.005, "value {at}: {found} is {expected}");
        }
        let states = |parts: &[&str]| lost.iter().any(|sentence| parts.iter().all(|part| sentence.contains(part)));
        assert!(states(&["2 Gaussians are outside 0 to 1", "0.90"]), "colors that others clamp: {lost:?}");
        assert!(states(&["view-dependent", "0.5"]), "coefficients that others clamp: {lost:?}");
        assert!(states(&["read back"]), "what is rounded: {lost:?}");
    }

    #[test]
    fn gaussians_without_view_dependent_color_have_none_in_the_file() {
        let mut columns = columns(3);
        for colors in columns.harmonics.values.chunks_exact_mut(12) {
            colors[3..].fill(0.0);
        }
        let (lost, found) = again(&columns);
        assert_eq!(sliced(&found).harmonics.degree, 0, "degree 0 is exact, and bytes of degree 1 are not");
        assert_eq!(lost.len(), 1, "only the rounding: {lost:?}");
    }

    #[test]
    fn large_splats_keep_their_places_beside_small_ones_and_outliers() {
        let mut columns = columns(200);
        columns.filter = None;
        for index in 0..200 {
            let x = index as f32 / 100.0 - 1.0;
            columns.mean[index] = [x, x * x, -x];
            columns.log_scale[index] = [if index % 2 == 0 { 2.5 } else { -6.0 }; 3];
            columns.motion[index] = Motion { velocity: [0.0, 3.0 * x, 0.0], mean_t: 1.0 + x.abs(), sigma_t: 0.2 };
        }
        columns.mean[7] = [900.0, 0.0, -40.0];
        columns.motion[8].velocity = [500.0, 0.0, 0.0];
        columns.motion[9].sigma_t = 1e-9;
        columns.motion[10].mean_t = 1e4;
        let rows = rows(&columns, &clip(), 4.0).expect("finite numbers");
        let (bytes, _) = encode(&columns, &clip()).expect("Gaussians that can be written");
        let times = Times { duration: 4.0, cutoff: f64::from(0.05_f32) };
        let file = File { coder: Coder::of(&rows, times), colors: Colors::of(&columns.harmonics), rows: &rows };
        let (again, order) = file.encode(UpAxis::NegZ).expect("small numbers");
        assert_eq!(again, bytes, "the same bytes");
        let deviation = Deviation::of(&bytes, &file.coder, &rows, &order).expect("it is decoded");
        assert!(deviation.place < 1e-3, "of the size of a splat of 0.0025: {deviation:?}");
        assert!(deviation.scale < 4e-6 && deviation.angle < 1e-3 && deviation.opacity < 1e-5, "{deviation:?}");
    }

    #[test]
    fn segments_that_are_not_contiguous_are_refused_with_the_way_out() {
        let mut columns = columns(1);
        let sets = ActiveSets::Bits(vec![1, 0, 1]);
        columns.filter = Some(TemporalFilter { kind: FilterKind::KeyFrame, segments: 3, count: 1, sets });
        let error = encode(&columns, &clip()).map(|(bytes, _)| bytes.len()).expect_err("two windows");
        assert!(error.to_string().contains("--sequence"), "{error}");
    }
}
