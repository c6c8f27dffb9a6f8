//! Layouts of Gaussians that move along straight lines and have a lifespan each.
//!
//! In: the table of a file of `FreeTimeGS`, or of the sources of `.sogst` and `.sog4d`, and its comments. Out: motion
//! for [`Columns`](crate::codec::import::columns::Columns), and how it is played.

use super::header::Comments;
use super::splats::rows;
use super::table::{Table, row};
use crate::codec::import::assumed;
use crate::codec::import::columns::{Motion, Played};
use crate::codec::import::error::ImportError;
use crate::codec::options::{FPS, ReadOptions};
use crate::gaussian::SMALLEST_CUTOFF;
use crate::scene::UpAxis;
use std::f32::consts::FRAC_1_SQRT_2;

/// Seconds of a clip whose file has neither its duration nor its number of frames.
pub(super) const UNKNOWN: f32 = 1.0;

/// Reads the motion of `FreeTimeGS`: times and velocities are those of a clip from 0 to 1.
///
/// # Errors
/// Another version, or unit of time; a property that is missing.
pub(super) fn free_time(
    table: &Table<'_>,
    comments: &Comments,
    options: &ReadOptions,
    lost: &mut Vec<String>,
) -> Result<(Vec<Motion>, Played), ImportError> {
    if let Some(version) = comments.value("ftgs_version").filter(|&version| version != "1") {
        let version = version.escape_debug();
        return Err(ImportError::unsupported(format!("is of version {version} of FreeTimeGS PLY; version 1 is read")));
    }
    if let Some(unit) = comments.value("time_units").filter(|&unit| unit != "normalized") {
        let unit = unit.escape_debug();
        return Err(ImportError::unsupported(format!(
            "has times in the unit {unit}; normalized times (0 to 1) are read"
        )));
    }
    let [time, log_duration] = table.all(["time", "log_duration"])?;
    let velocity = table.numbered::<3>("velocity")?;
    let moves = !comments.value("use_velocity").is_some_and(|used| used == "0" || used.eq_ignore_ascii_case("false"));
    let shortest = comments.number("min_duration")?.unwrap_or(0.0);
    if let Some(floor) = comments.number("opacity_floor")?.filter(|&floor| floor > 0.0) {
        lost.push(format!(
            "Players of FreeTimeGS show every Gaussian at all times with at least {floor} of its opacity; here it is drawn in its \
             lifespan alone."
        ));
    }
    let frames = comments.number("n_frames")?.filter(|&frames| frames >= 1.0);
    lost.extend(match frames {
        Some(frames) => assumed::speed(frames, options),
        None => assumed::duration(UNKNOWN, options),
    });
    let played = Played {
        duration_seconds: frames.map_or(UNKNOWN, |frames| frames / options.fps.unwrap_or(FPS)),
        ..moving([0.0, 1.0], SMALLEST_CUTOFF)
    };
    let motion = rows(table, |index| Motion {
        velocity: if moves { row(&velocity, index) } else { [0.0; 3] },
        mean_t: time.f32(index),
        sigma_t: log_duration.f32(index).exp().max(shortest),
    });
    Ok((motion, played))
}

/// Reads the motion of the interchange PLY of `.sogst`, in seconds.
///
/// # Errors
/// A file without its times; a property that is missing.
pub(super) fn sogst(
    table: &Table<'_>,
    comments: &Comments,
    options: &ReadOptions,
    lost: &mut Vec<String>,
) -> Result<(Vec<Motion>, Played), ImportError> {
    let [first, last] = ["sogst.time_min", "sogst.time_max"].map(|key| comments.number(key));
    let interval = match (first?, last?, options.time_interval) {
        (_, _, Some(interval)) => interval,
        (Some(first), Some(last), None) if last > first => [first, last],
        _ => {
            return Err(ImportError::damaged(
                "does not say the times of its clip (comments sogst.time_min and sogst.time_max): give them as the time interval",
            ));
        }
    };
    if let Some(scale) = comments.value("sogst.cov2d_scale") {
        let scale = scale.escape_debug();
        lost.push(format!("Its footprints were shaped with the factors cov2d_scale {scale}, which are not applied: splats are slightly smaller."));
    }
    let velocity = table.all(["vx", "vy", "vz"])?;
    let [center, sigma] = table.all(["t_center", "t_sigma"])?;
    let motion = rows(table, |index| Motion {
        velocity: row(&velocity, index),
        mean_t: center.f32(index),
        sigma_t: sigma.f32(index),
    });
    Ok((motion, moving(interval, SMALLEST_CUTOFF)))
}

/// Reads the motion of the source of `.sog4d`, in seconds. Its envelope is `exp(−(dt / s)²)`, so that σ_t is `s / √2`.
///
/// # Errors
/// Times of the clip that are no numbers; a property that is missing.
pub(super) fn sog4d(
    table: &Table<'_>,
    comments: &Comments,
    options: &ReadOptions,
    lost: &mut Vec<String>,
) -> Result<(Vec<Motion>, Played), ImportError> {
    /// The opacity below which its players draw nothing.
    const CUTOFF: f32 = 0.005;
    let words = || comments.value("cfg_args").unwrap_or("").split_ascii_whitespace();
    let number = |key: &str| {
        let found = words().find_map(|word| word.strip_prefix(key)?.strip_prefix('='));
        let is_usable = |value: &f32| value.is_finite();
        let number = |text: &str| text.parse::<f32>().ok().filter(is_usable);
        found
            .map(|text| {
                number(text).ok_or_else(|| ImportError::damaged(format!("its comment cfg_args has no number as {key}")))
            })
            .transpose()
    };
    let (start, duration) = (number("start")?.unwrap_or(0.0), number("duration")?);
    let duration = duration.unwrap_or_else(|| {
        lost.extend(assumed::duration(UNKNOWN, options));
        UNKNOWN
    });
    if duration <= 0.0 || start + duration <= start {
        return Err(ImportError::damaged(format!(
            "its comment cfg_args has the duration {duration}, no positive number"
        )));
    }
    let velocity = table.numbered::<3>("motion")?;
    let [center, scale] = table.all(["trbf_center", "trbf_scale"])?;
    let motion = rows(table, |index| Motion {
        velocity: row(&velocity, index),
        mean_t: center.f32(index),
        sigma_t: scale.f32(index).exp() * FRAC_1_SQRT_2,
    });
    Ok((motion, moving([start, start + duration], CUTOFF)))
}

/// Returns how a clip is played whose unit of time is the second.
fn moving(time_interval: [f32; 2], marginal_cutoff: f32) -> Played {
    let duration_seconds = time_interval[1] - time_interval[0];
    Played { up: UpAxis::NegY, time_interval, duration_seconds, marginal_cutoff }
}
