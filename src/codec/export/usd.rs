//! USD text files (.usda) with a `ParticleField3DGaussianSplat`, which is in version 26.03 of USD and later ones.
//!
//! In: [`Columns`] at rest or with motion, and the frames of the clip. Out: the file, +Y up. Of moving Gaussians,
//! positions and opacities have a sample for each frame; if it takes less space, as with a sequence of separate sets of
//! Gaussians, each frame has all values of its visible ones instead. Players interpolate between samples with the same
//! number of values: a frame of other Gaussians than the frame before, but as many, has one more, which is invisible.

use super::clip::Clip;
use super::y_up::y_up;
use crate::codec::import::columns::{Columns, Motion, sigmoid};
use crate::gaussian::Lifespan;
use glam::{Vec3, Vec4};
use std::io::{self, BufWriter, Write};

/// Most frames of a file.
const MOST_FRAMES: f64 = 1e6;

/// Writes Gaussians with their motion; one set of values if there is none, or if the clip is a still.
///
/// # Errors
/// Errors of the writer; a clip of more than a million frames.
pub(super) fn write(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let columns = &*y_up(columns, clip.up)?;
    let frames = Frames::of(columns, clip)?;
    let mut writer = BufWriter::new(writer);
    write_head(columns, &frames, clip, &mut writer)?;
    for attribute in ATTRIBUTES {
        write!(writer, "    {}", attribute.name)?;
        if frames.is_sampled(attribute) {
            writeln!(writer, ".timeSamples = {{")?;
            for frame in 0..frames.times.len() {
                write!(writer, "        {frame}: ")?;
                write_values(columns, &frames, attribute, frame, &mut writer)?;
                writeln!(writer, ",")?;
            }
            writeln!(writer, "    }}")?;
        } else {
            write!(writer, " = ")?;
            write_values(columns, &frames, attribute, 0, &mut writer)?;
            writeln!(writer)?;
        }
    }
    writeln!(writer, "}}")?;
    writer.flush()
}

/// An attribute of the particle field.
struct Attribute {
    /// Its type and name.
    name: &'static str,
    /// Whether it differs from frame to frame for the same Gaussian.
    moves: bool,
    /// Writes the value or the values of a Gaussian at a time.
    write: fn(&Columns, usize, &Moment, &mut dyn Write) -> io::Result<()>,
}

/// The state of a Gaussian in a frame.
struct Moment {
    mean: Vec3,
    opacity: f32,
}

/// The attributes with a value or values for each Gaussian.
const ATTRIBUTES: &[Attribute] = &[
    Attribute { name: "point3f[] positions", moves: true, write: |_, _, moment, writer| triple(moment.mean, writer) },
    Attribute {
        name: "quatf[] orientations",
        moves: false,
        write: |columns, index, _, writer| {
            let [w, x, y, z] = Vec4::from(columns.rotation[index]).normalize_or(Vec4::X).to_array();
            write!(writer, "({w}, {x}, {y}, {z})")
        },
    },
    Attribute {
        name: "float3[] scales",
        moves: false,
        write: |columns, index, _, writer| triple(Vec3::from(columns.log_scale[index].map(f32::exp)), writer),
    },
    Attribute {
        name: "float[] opacities",
        moves: true,
        // Four digits are finer than any picture shows.
        write: |_, _, moment, writer| write!(writer, "{}", (moment.opacity * 1e4).round() / 1e4),
    },
    Attribute {
        name: "float3[] radiance:sphericalHarmonicsCoefficients",
        moves: false,
        write: |columns, index, _, writer| {
            for (place, value) in columns.harmonics.of(index).chunks_exact(3).enumerate() {
                if place > 0 {
                    write!(writer, ", ")?;
                }
                triple(Vec3::from_slice(value), writer)?;
            }
            Ok(())
        },
    },
];

/// The frames of a file.
struct Frames {
    /// The timestamp of each frame; a still has one.
    times: Vec<f32>,
    /// Whether values are samples in time.
    moves: bool,
    /// Whether each frame has only its visible Gaussians.
    is_separate: bool,
    /// The separate frames with an invisible Gaussian at their end.
    is_padded: Vec<bool>,
    interval: [f32; 2],
    cutoff: f32,
}

impl Frames {
    fn of(columns: &Columns, clip: &Clip) -> io::Result<Self> {
        let [first, last] = clip.time_interval;
        let (interval, cutoff) = (clip.time_interval, clip.marginal_cutoff);
        let steps = (f64::from(clip.duration_seconds) * f64::from(clip.fps)).round();
        let moves = (!columns.motion.is_empty() || columns.filter.is_some()) && steps >= 1.0;
        if !moves {
            return Ok(Self {
                times: vec![first],
                moves,
                is_separate: false,
                is_padded: vec![false],
                interval,
                cutoff,
            });
        }
        if steps > MOST_FRAMES {
            let reason = format!("{steps} frames are too many for a USD file: state fewer frames a second");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        let time = |step: u32| (f64::from(first) + f64::from(last - first) * (f64::from(step) / steps)) as f32;
        let times: Vec<f32> = (0..=steps as u32).map(time).collect();
        let is_padded = vec![false; times.len()];
        let mut frames = Self { times, moves, is_separate: false, is_padded, interval, cutoff };
        // Numbers of a Gaussian. Frames with all Gaussians sample only 4 of them: position and opacity.
        let values = 11 + columns.harmonics.coefficients * 3;
        let visible: usize = (0..frames.times.len()).map(|frame| frames.visible(columns, frame).count()).sum();
        let together = columns.len() * (values - 4 + 4 * frames.times.len());
        frames.is_separate = visible * values < together;
        if frames.is_separate {
            frames.pad(columns);
        }
        Ok(frames)
    }

    /// Returns the visible Gaussians of a frame.
    fn visible(&self, columns: &Columns, frame: usize) -> impl Iterator<Item = usize> {
        let time = self.times[frame];
        (0..columns.len()).filter(move |&index| self.moment(columns, index, time).opacity > 0.0)
    }

    /// Gives a frame whose Gaussians are others than those of the frame before a different number of values.
    fn pad(&mut self, columns: &Columns) {
        let (mut before, mut was_padded) = (Vec::<usize>::new(), false);
        for frame in 0..self.times.len() {
            let own: Vec<usize> = self.visible(columns, frame).collect();
            if own != before {
                was_padded = !own.is_empty() && own.len() == before.len() + usize::from(was_padded);
                before = own;
            }
            self.is_padded[frame] = was_padded;
        }
    }

    /// Returns whether an attribute has a sample for each frame.
    fn is_sampled(&self, attribute: &Attribute) -> bool {
        self.moves && (attribute.moves || self.is_separate)
    }

    /// Returns the state of a Gaussian at a time.
    fn moment(&self, columns: &Columns, index: usize, time: f32) -> Moment {
        let mean = Vec3::from(columns.mean[index]);
        let opacity = sigmoid(columns.opacity_logit[index]);
        let is_active = columns
            .filter
            .as_ref()
            .is_none_or(|filter| filter.is_active(filter.segment_of(time, self.interval), index));
        let Some(&Motion { velocity, mean_t, sigma_t }) = columns.motion.get(index) else {
            return Moment { mean, opacity: if is_active { opacity } else { 0.0 } };
        };
        let marginal = Lifespan { mean_t, sigma_t }.marginal(time);
        let opacity = if is_active && marginal > self.cutoff { opacity * marginal } else { 0.0 };
        Moment { mean: mean + Vec3::from(velocity) * (time - mean_t), opacity }
    }
}

/// Writes the head of the file, and of the particle field what is not sampled.
fn write_head(columns: &Columns, frames: &Frames, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &time in &frames.times {
        for index in 0..columns.len() {
            let Moment { mean, opacity } = frames.moment(columns, index, time);
            if opacity > 0.0 {
                let reach = 3.0 * columns.log_scale[index].map(f32::exp).into_iter().fold(0.0, f32::max);
                (low, high) = (low.min(mean - reach), high.max(mean + reach));
            }
        }
    }
    writeln!(writer, "#usda 1.0\n(\n    defaultPrim = \"Gaussians\"\n    metersPerUnit = 1\n    upAxis = \"Y\"")?;
    if frames.moves {
        let (last, fps) = (frames.times.len() - 1, clip.fps);
        writeln!(writer, "    startTimeCode = 0\n    endTimeCode = {last}")?;
        writeln!(writer, "    timeCodesPerSecond = {fps}\n    framesPerSecond = {fps}")?;
    }
    writeln!(writer, ")\n\ndef ParticleField3DGaussianSplat \"Gaussians\"\n{{")?;
    if low.x <= high.x {
        write!(writer, "    float3[] extent = [")?;
        triple(low, writer)?;
        write!(writer, ", ")?;
        triple(high, writer)?;
        writeln!(writer, "]")?;
    }
    writeln!(writer, "    uniform token projectionModeHint = \"perspective\"")?;
    writeln!(writer, "    uniform token sortingModeHint = \"zDepth\"")?;
    writeln!(writer, "    uniform int radiance:sphericalHarmonicsDegree = {}", columns.harmonics.degree)
}

/// Writes the array of an attribute: of all Gaussians at the time of a frame, or of those that are visible then.
fn write_values(
    columns: &Columns,
    frames: &Frames,
    attribute: &Attribute,
    frame: usize,
    writer: &mut dyn Write,
) -> io::Result<()> {
    write!(writer, "[")?;
    let mut last = None;
    for index in 0..columns.len() {
        let moment = frames.moment(columns, index, frames.times[frame]);
        if frames.is_separate && moment.opacity <= 0.0 {
            continue;
        }
        if last.is_some() {
            write!(writer, ", ")?;
        }
        (attribute.write)(columns, index, &moment, writer)?;
        last = Some((index, moment.mean));
    }
    if let Some((index, mean)) = last.filter(|_| frames.is_padded[frame]) {
        write!(writer, ", ")?;
        (attribute.write)(columns, index, &Moment { mean, opacity: 0.0 }, writer)?;
    }
    write!(writer, "]")
}

fn triple(Vec3 { x, y, z }: Vec3, writer: &mut dyn Write) -> io::Result<()> {
    write!(writer, "({x}, {y}, {z})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::export::samples;
    use crate::scene::{ActiveSets, FilterKind, TemporalFilter, UpAxis};

    fn written(columns: &Columns, clip: &Clip) -> String {
        let mut bytes = Vec::new();
        write(columns, clip, &mut bytes).expect("memory");
        String::from_utf8(bytes).expect("text")
    }

    /// The text behind the equal sign of an attribute, in one line or one line for each frame.
    fn values<'a>(text: &'a str, attribute: &str) -> Vec<&'a str> {
        let (_, rest) = text.split_once(attribute).expect("the attribute");
        if let Some(samples) = rest.strip_prefix(".timeSamples = {\n") {
            samples.lines().take_while(|line| line.trim() != "}").map(str::trim).collect()
        } else {
            vec![rest.lines().next().expect("a line").trim_start_matches(" = ")]
        }
    }

    fn moving(count: usize) -> Columns {
        let motion = |index: usize| Motion { velocity: [0.0, index as f32, 0.0], mean_t: 0.5, sigma_t: 0.25 };
        Columns { motion: (0..count).map(motion).collect(), ..samples::columns(count, 1) }
    }

    fn clip(seconds: f32) -> Clip {
        Clip { duration_seconds: seconds, fps: 4.0, ..samples::clip(UpAxis::PosY) }
    }

    #[test]
    fn gaussians_at_rest_have_one_value_for_each_attribute() {
        let columns = samples::columns(3, 1);
        let text = written(&columns, &clip(2.0));
        assert!(text.starts_with("#usda 1.0\n("), "the first line of a USD text file");
        assert!(!text.contains("timeSamples") && !text.contains("endTimeCode"), "a still has no samples in time");
        let [x, y, z] = columns.mean[0];
        let positions = values(&text, "point3f[] positions");
        assert!(positions[0].starts_with(&format!("[({x}, {y}, {z}), ")), "positions: {positions:?}");
        let degree = "uniform int radiance:sphericalHarmonicsDegree = 1\n";
        assert!(text.contains(degree), "the degree of the colors");
        let colors = values(&text, "sphericalHarmonicsCoefficients");
        assert_eq!(colors[0].matches('(').count(), 3 * 4, "4 coefficients of each of 3 Gaussians");
        assert_eq!(values(&text, "quatf[] orientations")[0].matches('(').count(), 3, "one rotation each");
    }

    #[test]
    fn moving_gaussians_have_a_sample_for_each_frame() {
        let text = written(&moving(2), &clip(1.0));
        assert!(text.contains("    endTimeCode = 4\n    timeCodesPerSecond = 4\n"), "the first and the last moment");
        let (positions, opacities) = (values(&text, "positions"), values(&text, "opacities"));
        assert_eq!((positions.len(), opacities.len()), (5, 5), "4 frames a second, and the end");
        let y = |line: &str| -> f32 {
            let second = line.split('(').nth(2).expect("a second Gaussian");
            second.split(", ").nth(1).expect("y").parse().expect("a number")
        };
        let step = y(positions[3]) - y(positions[1]);
        assert!((step - 0.5).abs() < 1e-5, "half of the interval at a velocity of 1: {step}");
        assert_eq!(opacities[0].matches(',').count(), 2, "each Gaussian is in each frame");
        assert_eq!(values(&text, "scales").len(), 1, "scales do not move");
        let still = written(&moving(2), &clip(0.0));
        assert!(!still.contains("timeSamples"), "a clip of no length is a still");
    }

    #[test]
    fn a_sequence_of_separate_gaussians_has_only_the_visible_ones_in_each_frame() {
        let count = 40;
        let intervals = (0..count as u32).map(|index| (index / 10) | ((index / 10) << 16)).collect();
        let filter =
            TemporalFilter { kind: FilterKind::Interval, segments: 4, count, sets: ActiveSets::Intervals(intervals) };
        let columns = Columns { filter: Some(filter), ..samples::columns(count, 0) };
        let clip = Clip { fps: 40.0, ..clip(1.0) };
        let text = written(&columns, &clip);
        let (positions, scales) = (values(&text, "positions"), values(&text, "scales"));
        assert_eq!((positions.len(), scales.len()), (41, 41), "every attribute has a sample for each frame");
        let [x, y, z] = columns.mean[20];
        assert!(positions[20].starts_with(&format!("20: [({x}, {y}, {z}), ")), "the third set begins at one half");
        assert_eq!(positions[20].matches('(').count(), 10, "10 of 40 Gaussians");
        let numbers =
            [9, 10, 19, 20, 30].map(|frame| [positions[frame], scales[frame]].map(|of| of.matches('(').count()));
        let expected = [[10; 2], [11; 2], [11; 2], [10; 2], [11; 2]];
        assert_eq!(numbers, expected, "no two sets that follow each other have as many, so that none is interpolated");
        assert!(values(&text, "opacities")[10].ends_with(", 0],"), "the Gaussian that is added is invisible");
    }

    #[test]
    fn too_many_frames_are_refused() {
        let refused = write(&moving(1), &clip(f32::MAX), &mut Vec::new());
        assert!(refused.is_err(), "a file without end");
    }
}
