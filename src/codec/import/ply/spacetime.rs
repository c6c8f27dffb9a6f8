//! Layouts of Gaussians on curved paths: Spacetime Gaussians without a decoder ("lite"), and the interchange PLY of `.sogst` with an acceleration.
//!
//! In: the table of a file. Out: lifespans, and the [`Bend`]s of the paths.

use super::layout::Layout;
use super::splats::rows;
use super::table::{Table, row};
use crate::codec::import::columns::{Columns, Motion, Played, coefficient};
use crate::codec::import::cubic::{Bend, sigma_of_width, spacetime_clip};
use crate::codec::import::error::ImportError;
use crate::codec::options::ReadOptions;

/// Reads the lifespans and the velocities of Spacetime Gaussians, whose clip goes from 0 to 1.
///
/// # Errors
/// A property that is missing.
pub(super) fn lifespans(
    table: &Table<'_>,
    options: &ReadOptions,
    lost: &mut Vec<String>,
) -> Result<(Vec<Motion>, Played), ImportError> {
    let velocity = table.numbered::<3>("motion")?;
    let [center, scale] = table.all(["trbf_center", "trbf_scale"])?;
    let motion = rows(table, |index| Motion {
        velocity: row(&velocity, index),
        mean_t: center.f32(index),
        sigma_t: sigma_of_width(scale.f32(index).exp()),
    });
    Ok((motion, spacetime_clip(options, lost)))
}

/// Reads how paths differ from straight lines; `None` for layouts of straight lines.
///
/// # Errors
/// A property that is missing.
pub(super) fn bends(layout: Layout, table: &Table<'_>) -> Result<Option<Vec<Bend>>, ImportError> {
    match layout {
        Layout::Spacetime => {
            let (motion, turn) = (table.numbered::<9>("motion")?, table.numbered::<4>("omega")?);
            let bend = |index| {
                let [_, _, _, second @ .., a, b, c] = row(&motion, index);
                Bend { second, third: [a, b, c], turn: row(&turn, index) }
            };
            Ok(Some(rows(table, bend)))
        }
        Layout::SogstCurved => {
            let acceleration = table.all(["ax", "ay", "az"])?;
            Ok(Some(rows(table, |index| Bend { second: row(&acceleration, index), ..Bend::default() })))
        }
        _ => Ok(None),
    }
}

/// Changes the colors of Spacetime Gaussians, which are red, green and blue from 0 to 1, to coefficients.
pub(super) fn decode_colors(columns: &mut Columns) {
    columns.harmonics.values.iter_mut().for_each(|value| *value = coefficient(*value));
}

#[cfg(test)]
mod tests {
    use super::super::fixture::File;
    use super::*;
    use crate::codec::import::source::{InMemory, Source};
    use crate::scene::{Form, SceneForm};
    use glam::Vec3;
    use std::path::Path;

    /// Reads a file and returns the active mean of its only path at some times, and the red coefficient.
    fn path(bytes: &[u8], interval: [f32; 2]) -> (Vec<(f32, Vec3)>, f32) {
        let source = Source { bytes, beside: &InMemory::default() };
        let found = super::super::read(&source, &ReadOptions::default()).expect("a whole file");
        let SceneForm::Ready(Form::Sliced(sliced)) = &found.scene.form else { panic!("moving Gaussians are sliced") };
        let filter = found.scene.filter.as_ref().expect("pieces have a filter");
        let at = |step: u32| {
            let time = interval[0] + (interval[1] - interval[0]) * step as f32 / 20.0;
            let segment = filter.segment_of(time, interval);
            let active: Vec<usize> =
                (0..sliced.gaussians.len()).filter(|&index| filter.is_active(segment, index)).collect();
            let [index] = active[..] else { panic!("one piece at {time}: {active:?}") };
            (time, sliced.gaussians[index].mean_at(time))
        };
        ((0..=20).map(at).collect(), sliced.harmonics.values[0])
    }

    #[test]
    fn spacetime_gaussians_follow_their_cubic_paths_and_have_plain_colors() {
        let mut file = File::splats(1, 0).with("trbf_center", |_| 0.25).with("trbf_scale", |_| 3.0);
        let factors: Vec<f32> = (0..9).map(|number| (number as f32 - 3.0) * 0.7).collect();
        for (number, &factor) in factors.iter().enumerate() {
            file = file.with(&format!("motion_{number}"), |_| factor);
        }
        for number in 0..4 {
            file = file.with(&format!("omega_{number}"), |_| 0.1);
        }
        let mean = Vec3::new(file.value("x", 0), file.value("y", 0), file.value("z", 0));
        let (found, red) = path(&file.little(), [0.0, 1.0]);
        let largest = (0..3).map(|axis| file.value(&format!("scale_{axis}"), 0).exp()).fold(0.0, f32::max);
        for (time, at) in found {
            let d = time - 0.25;
            let power = |first: usize| Vec3::from_slice(&factors[first..]);
            let expected = mean + power(0) * d + power(3) * d * d + power(6) * d * d * d;
            assert!(at.distance(expected) < 0.25 * largest + 1e-3, "at {time}: {at} is {expected}");
        }
        assert_eq!(red, coefficient(file.value("f_dc_0", 0)), "f_dc is the color itself");
    }

    #[test]
    fn an_acceleration_bends_the_paths_of_sogst() {
        let mut file =
            File::splats(1, 9).comment("sogst.time_min 2").comment("sogst.time_max 4").with("t_center", |_| 3.0);
        file = file.with("t_sigma", |_| 50.0);
        for (name, value) in [("vx", 1.0), ("vy", 0.0), ("vz", 0.5), ("ax", 0.0), ("ay", -9.0), ("az", 0.0)] {
            file = file.with(name, |_| value);
        }
        let mean = Vec3::new(file.value("x", 0), file.value("y", 0), file.value("z", 0));
        let largest = (0..3).map(|axis| file.value(&format!("scale_{axis}"), 0).exp()).fold(0.0, f32::max);
        for (time, at) in path(&file.little(), [2.0, 4.0]).0 {
            let d = time - 3.0;
            let expected = mean + Vec3::new(d, -9.0 * d * d, 0.5 * d);
            assert!(at.distance(expected) < 0.25 * largest + 1e-3, "at {time}: {at} is {expected}");
        }
    }
}
