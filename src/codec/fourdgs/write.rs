//! Writing `.4dgs` files.
//!
//! In: moving Gaussians, with the temporal filter of the capture if it has one. Out: the bytes of a file; an interval of the filter is a window.

use crate::codec::export::table::Clip;
use crate::codec::import::columns::{Columns, SH_C0};
use crate::scene::FilterKind;
use fourdgs::quantization::{Profile, sh_coefficient};
use fourdgs::{GaussianSet, SceneExtras, WriteOptions, write_to_vec};
use std::io::{self, Write};

/// Writes a file.
///
/// # Errors
/// Gaussians whose active segments are not contiguous; values that are too large for the format; errors of the writer.
pub(crate) fn write(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let [first, last] = clip.time_interval;
    let span = last - first;
    // The times of a file are seconds from its beginning.
    let duration = if clip.duration_seconds > 0.0 { clip.duration_seconds } else { 1.0 };
    let seconds = duration / span;
    let windows = windows(columns, duration)?;
    let coefficients = columns.harmonics.coefficients - 1;
    let mut set = GaussianSet {
        sh: (coefficients > 0).then(Vec::new),
        sh_coefficients: coefficients,
        sh_degree: columns.harmonics.degree as u8,
        ..GaussianSet::default()
    };
    for index in 0..columns.len() {
        let motion = columns.motion.get(index);
        let [w, x, y, z] = columns.rotation[index];
        let rotation = glam::Vec4::new(x, y, z, w).normalize_or(glam::Vec4::W);
        let colors = columns.harmonics.of(index);
        let opacity = 1.0 / (1.0 + (-columns.opacity_logit[index]).exp());
        set.positions.extend(columns.mean[index]);
        set.scales.extend(columns.log_scale[index].map(f32::exp));
        set.rotations.extend(rotation.to_array());
        set.colors.extend([0, 1, 2].map(|channel| (0.5 + SH_C0 * colors[channel]).clamp(0.0, 1.0)));
        set.colors.push(opacity);
        set.motions.extend(motion.map_or([0.0; 3], |motion| motion.velocity.map(|velocity| velocity / seconds)));
        set.mu_t.push(motion.map_or(0.0, |motion| (motion.mean_t - first) * seconds));
        set.sigma_t.push(motion.map_or(f32::INFINITY, |motion| motion.sigma_t * seconds));
        let [opens, closes] = windows.get(index).copied().unwrap_or([0.0, f32::INFINITY]);
        set.win_lo.push(opens);
        set.win_hi.push(closes);
        if let Some(coded) = &mut set.sh {
            for channel in 0..3 {
                coded.extend(colors.iter().skip(3 + channel).step_by(3).map(|&value| byte(value)));
            }
        }
    }
    let options = WriteOptions {
        profile: Profile::Fine,
        cutoff: f64::from(clip.marginal_cutoff),
        library: concat!("bevy_gs4d ", env!("CARGO_PKG_VERSION")).to_owned(),
        ..WriteOptions::default()
    };
    let bytes = write_to_vec(&set, f64::from(duration), &options, &SceneExtras::default()).map_err(io::Error::other)?;
    writer.write_all(&bytes)
}

/// Returns when each Gaussian exists, seconds; nothing if all exist always.
fn windows(columns: &Columns, duration: f32) -> io::Result<Vec<[f32; 2]>> {
    // A filter of lifespans shows nothing that they do not show.
    let Some(filter) = columns.filter.as_ref().filter(|filter| filter.kind != FilterKind::Support) else {
        return Ok(Vec::new());
    };
    let intervals = filter.to_intervals().ok_or_else(|| {
        io::Error::other("its temporal filter has Gaussians that are active in separate segments of time")
    })?;
    let time = |segment: u32| duration * segment as f32 / filter.segments as f32;
    let window = |&word: &u32| {
        let (first, last) = (word & 0xffff, word >> 16);
        match (first <= last, last + 1 >= filter.segments) {
            (false, _) => [0.0, 0.0],
            // The end of the duration belongs to the last segment.
            (true, true) => [time(first), f32::INFINITY],
            (true, false) => [time(first), time(last + 1)],
        }
    };
    Ok(intervals.iter().map(window).collect())
}

/// Returns the code of a color coefficient.
fn byte(value: f32) -> u8 {
    let [lowest, highest] = [0, 255].map(|code| sh_coefficient(code) as f32);
    ((value - lowest) / (highest - lowest) * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::fourdgs::read;
    use crate::codec::import::columns::{Motion, logit};
    use crate::codec::import::source::{InMemory, Source};
    use crate::codec::options::ReadOptions;
    use crate::scene::{ActiveSets, Form, SceneForm, TemporalFilter, UpAxis};

    #[test]
    fn a_written_file_is_read_as_the_same_gaussians() {
        let mut columns = Columns::with_capacity(2, 1);
        for index in 0..2u8 {
            let x = f32::from(index);
            columns.mean.push([x, 0.5, -0.25]);
            columns.log_scale.push([-3.0, -2.0, -4.0]);
            columns.rotation.push([2.0, 0.0, 0.0, 0.0]);
            columns.opacity_logit.push(logit(0.75));
            columns.harmonics.values.extend((0..12).map(|value| (value as f32 - 6.0) * 0.1));
            columns.motion.push(Motion { velocity: [0.25, 0.0, x], mean_t: 2.0, sigma_t: 0.5 + x });
        }
        let sets = ActiveSets::Intervals(vec![1 << 16, 2 | 3 << 16]);
        columns.filter = Some(TemporalFilter { kind: FilterKind::Window, segments: 4, count: 2, sets });
        let clip = Clip {
            time_interval: [1.0, 3.0],
            duration_seconds: 4.0,
            fps: 30.0,
            up: UpAxis::PosY,
            marginal_cutoff: 0.05,
        };
        let mut bytes = Vec::new();
        write(&columns, &clip, &mut bytes).expect("a scene that fits");
        let source = Source { bytes: &bytes, beside: &InMemory::default() };
        let found = read(&source, &ReadOptions::default()).expect("a whole file");
        let SceneForm::Ready(Form::Sliced(sliced)) = &found.scene.form else { panic!("sliced") };
        let filter = found.scene.filter.as_ref().expect("windows");
        let near = |a: f32, b: f32| (a - b).abs() < 0.02;
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
            assert!(
                near(gaussian.sigma_t, (0.5 + x) * 2.0) && near(gaussian.opacity, 0.75),
                "its lifespan and opacity"
            );
            let colors = sliced.harmonics.of(index);
            assert!(near(colors[3], -0.3) && near(colors[11], 0.5), "its colors: {colors:?}");
        }
    }
}
