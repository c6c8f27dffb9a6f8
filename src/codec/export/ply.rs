//! PLY files of Gaussians: those of 3DGS, and those of `FreeTimeGS` with motion.
//!
//! In: [`Columns`]. Out: binary little-endian floats, with the properties of the original trainer in its order.
//! Positions are those of the capture: a comment states the axis that points up, unless it is -y as in files of
//! trainers. If the capture has an origin, positions are those of its files, in double precision. Another comment states
//! training with the filter of Mip-Splatting.

use super::clip::Clip;
use crate::codec::import::columns::{Columns, Motion};
use crate::codec::import::ply::axes::UP;
use crate::codec::import::ply::origin::ORIGIN;
use crate::scene::UpAxis;
use std::io::{self, Write};

/// The comment with the shortest lifespan, which is 0: lifespans are exported unchanged.
const SHORTEST: &str = "min_duration 0";
/// The comment about training with the filter of Mip-Splatting, as Brush writes it.
const MIP_FILTER: &str = "SplatRenderMode: mip";
/// Temporal deviation of a Gaussian that is always present, in clip lengths: its marginal is 1 in single precision.
const ALWAYS: f32 = 1e4;

/// Writes Gaussians at rest as 3DGS trainers do.
///
/// # Errors
/// Errors of the writer.
pub(super) fn write_instant(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    write_header(columns, clip, &[], &[], writer)?;
    let mut record = Vec::new();
    for index in 0..columns.len() {
        record.clear();
        write_position(columns, index, writer)?;
        push_still(columns, index, &mut record);
        writer.write_all(bytes(&mut record))?;
    }
    Ok(())
}

/// Writes moving Gaussians as `FreeTimeGS` does: times and lifespans are parts of the clip.
///
/// # Errors
/// Errors of the writer.
pub(super) fn write_moving(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let [first, last] = clip.time_interval;
    let span = last - first;
    // Frames are at even steps from the first to the last moment, both included.
    let frames = (f64::from(clip.duration_seconds) * f64::from(clip.fps)).round().max(1.0);
    let comments = [
        "ftgs_version 1".to_owned(),
        "time_units normalized".to_owned(),
        format!("sh_degree {}", columns.harmonics.degree),
        "use_velocity true".to_owned(),
        SHORTEST.to_owned(),
        "opacity_floor 0".to_owned(),
        format!("n_frames {frames}"),
    ];
    let more = ["time", "log_duration", "velocity_0", "velocity_1", "velocity_2"];
    write_header(columns, clip, &comments, &more, writer)?;
    let mut record = Vec::new();
    for (index, &Motion { velocity, mean_t, sigma_t }) in columns.motion.iter().enumerate() {
        record.clear();
        write_position(columns, index, writer)?;
        push_still(columns, index, &mut record);
        record.push((mean_t - first) / span);
        record.push((sigma_t / span).min(ALWAYS).ln());
        record.extend(velocity.map(|velocity| velocity * span));
        writer.write_all(bytes(&mut record))?;
    }
    Ok(())
}

fn write_header(
    columns: &Columns,
    clip: &Clip,
    comments: &[String],
    more: &[&str],
    writer: &mut dyn Write,
) -> io::Result<()> {
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    let mip_filter = columns.mip_filter.then(|| MIP_FILTER.to_owned());
    for comment in comments.iter().chain(&space(columns, clip)).chain(&mip_filter) {
        header += &format!("comment {comment}\n");
    }
    header += &format!("element vertex {}\n", columns.len());
    let place = if has_origin(columns) { "double" } else { "float" };
    for name in ["x", "y", "z"] {
        header += &format!("property {place} {name}\n");
    }
    let rest = (columns.harmonics.coefficients - 1) * 3;
    let counted = |stem: &str, count: usize| (0..count).map(|i| format!("{stem}_{i}")).collect::<Vec<_>>();
    let mut names: Vec<String> = ["nx", "ny", "nz"].map(str::to_owned).into();
    names.extend(counted("f_dc", 3).into_iter().chain(counted("f_rest", rest)));
    names.push("opacity".to_owned());
    names.extend(counted("scale", 3).into_iter().chain(counted("rot", 4)));
    names.extend(more.iter().map(|&name| name.to_owned()));
    for name in names {
        header += &format!("property float {name}\n");
    }
    writer.write_all((header + "end_header\n").as_bytes())
}

/// Returns the comments about the space of a file.
fn space(columns: &Columns, clip: &Clip) -> Vec<String> {
    let [x, y, z] = columns.origin;
    let up = (clip.up != UpAxis::NegY).then(|| format!("{UP} {}", clip.up.name()));
    let origin = has_origin(columns).then(|| format!("{ORIGIN} {x} {y} {z}"));
    up.into_iter().chain(origin).collect()
}

fn has_origin(columns: &Columns) -> bool {
    columns.origin != [0.0; 3]
}

/// Writes the position of a Gaussian in the coordinates of the capture's files.
fn write_position(columns: &Columns, index: usize, writer: &mut dyn Write) -> io::Result<()> {
    for (mean, origin) in columns.mean[index].into_iter().zip(columns.origin) {
        if has_origin(columns) {
            writer.write_all(&(origin + f64::from(mean)).to_le_bytes())?;
        } else {
            writer.write_all(&mean.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Appends the other values of a Gaussian at rest. Coefficients above degree 0 are in channel order: all of red first.
fn push_still(columns: &Columns, index: usize, record: &mut Vec<f32>) {
    let colors = columns.harmonics.of(index);
    let (first, rest) = colors.split_at(3);
    record.extend([0.0; 3]);
    record.extend(first);
    for channel in 0..3 {
        record.extend(rest.iter().skip(channel).step_by(3));
    }
    record.push(columns.opacity_logit[index]);
    record.extend(columns.log_scale[index]);
    record.extend(columns.rotation[index]);
}

/// Returns the bytes of a record, which is changed to little-endian values.
fn bytes(record: &mut [f32]) -> &[u8] {
    for value in record.iter_mut() {
        *value = f32::from_bits(value.to_bits().to_le());
    }
    bytemuck::cast_slice(record)
}
