//! Frames of motion in a PLY file, as Brush plays them: each adds changes to the Gaussians of the element `vertex`.
//!
//! In: the elements `delta_vertex_*`, one for each frame, with values in the ranges of `meta_delta_min_*` and
//! `meta_delta_max_*` before them. Out: [`Imported`]: the path of each Gaussian in straight pieces that end at frames.

use super::table::{Column, Table};
use crate::codec::import::assumed;
use crate::codec::import::columns::{Columns, Played};
use crate::codec::import::drawable::keep_drawable_and;
use crate::codec::import::error::ImportError;
use crate::codec::import::imported::Imported;
use crate::codec::import::in_pieces::{in_pieces, middle_scale, splitting, statements};
use crate::codec::options::{FPS, InvalidOption, ReadOptions};
use crate::scene::pieces::{ALWAYS, Bends, Curve, Piece};
use crate::scene::{MAX_SEGMENTS, UpAxis};
use glam::{DQuat, DVec3, DVec4};
use rayon::prelude::*;

const FRAME: &str = "delta_vertex_";
const LOW: &str = "meta_delta_min_";
const HIGH: &str = "meta_delta_max_";

/// Returns whether an element belongs to frames of motion.
pub(super) fn is_element(name: &str) -> bool {
    [FRAME, LOW, HIGH].iter().any(|beginning| name.starts_with(beginning))
}

/// The changes of a frame; `None` for values that do not change.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame<'a> {
    mean: Option<[Change<'a>; 3]>,
    log_scale: Option<[Change<'a>; 3]>,
    rotation: Option<[Change<'a>; 4]>,
}

/// The changes of one value.
#[derive(Debug, Clone, Copy)]
struct Change<'a> {
    column: Column<'a>,
    low: f64,
    range: f64,
}

impl Change<'_> {
    /// Returns the change of a Gaussian. Brush divides integers by their largest value less 1.
    fn of(&self, row: usize) -> f64 {
        let part = self.column.f64(row) / self.column.largest().map_or(1.0, |largest| largest - 1.0);
        self.low + part * self.range
    }
}

impl Frame<'_> {
    fn is_finite(&self, row: usize) -> bool {
        let (mean, log_scale) = (changes(self.mean, row), changes(self.log_scale, row));
        mean.iter().chain(&log_scale).chain(&changes(self.rotation, row)).all(|value| value.is_finite())
    }
}

/// Returns the changes of a Gaussian; 0 if its frame has none.
fn changes<const N: usize>(of: Option<[Change<'_>; N]>, row: usize) -> [f64; N] {
    of.map_or([0.0; N], |all| all.map(|change| change.of(row)))
}

/// Returns the frames of a file with `count` Gaussians, in order.
///
/// # Errors
/// A frame that does not have a row for each Gaussian.
pub(super) fn frames<'a>(tables: &'a [Table<'_>], count: usize) -> Result<Vec<Frame<'a>>, ImportError> {
    let (mut low, mut high, mut frames) = (None, None, Vec::new());
    for table in tables {
        if table.name.starts_with(LOW) {
            low = Some(table);
        } else if table.name.starts_with(HIGH) {
            high = Some(table);
        } else if table.name.starts_with(FRAME) {
            if table.len() != count {
                return Err(ImportError::unsupported(format!(
                    "has a frame of motion ({}) of {} points, but {count} Gaussians: frames of a mesh that carries the Gaussians are not read; \
                     export each frame as a 3DGS PLY and open the folder of these",
                    table.name.escape_debug(),
                    table.len()
                )));
            }
            frames.push(Frame {
                mean: columns(table, ["x", "y", "z"], low, high),
                log_scale: columns(table, ["scale_0", "scale_1", "scale_2"], low, high),
                rotation: columns(table, ["rot_0", "rot_1", "rot_2", "rot_3"], low, high),
            });
        }
    }
    Ok(frames)
}

/// Returns the changes of some values; `None` if the frame does not have all of them. Without ranges, values are
/// changes.
fn columns<'a, const N: usize>(
    table: &'a Table<'_>,
    names: [&str; N],
    low: Option<&Table<'_>>,
    high: Option<&Table<'_>>,
) -> Option<[Change<'a>; N]> {
    let found = table.all(names).ok()?;
    let limit = |of: Option<&Table<'_>>, name: &str| of.and_then(|of| of.column(name)).map(|column| column.f64(0));
    Some(std::array::from_fn(|index| {
        let (low, high) = (limit(low, names[index]).unwrap_or(0.0), limit(high, names[index]).unwrap_or(1.0));
        Change { column: found[index], low, range: high - low }
    }))
}

/// Gaussians and the frames of their motion.
struct Animated<'a> {
    whole: Columns,
    frames: &'a [Frame<'a>],
    /// The row of each Gaussian in the file.
    rows: Vec<usize>,
    /// First and last timestamp.
    interval: [f64; 2],
}

impl Animated<'_> {
    /// Returns the values of a Gaussian at a time, between those of two frames; `of` returns the changes in a frame.
    fn at<const N: usize>(
        &self,
        index: usize,
        time: f64,
        at_rest: [f32; N],
        of: impl Fn(&Frame<'_>, usize) -> [f64; N],
    ) -> [f64; N] {
        let last = self.frames.len().saturating_sub(1);
        let [begin, end] = self.interval;
        let at = ((time - begin) / (end - begin) * last as f64).clamp(0.0, last as f64);
        let before = at as usize;
        let row = self.rows[index];
        let [a, b] = [before, (before + 1).min(last)].map(|frame| of(&self.frames[frame], row));
        std::array::from_fn(|axis| f64::from(at_rest[axis]) + a[axis] + (b[axis] - a[axis]) * at.fract())
    }

    fn mean(&self, index: usize, time: f64) -> DVec3 {
        self.at(index, time, self.whole.mean[index], |frame, row| changes(frame.mean, row)).into()
    }

    fn log_scale(&self, piece: &Piece, time: f32) -> [f32; 3] {
        let index = piece.source as usize;
        let at_rest = self.whole.log_scale[index];
        self.at(index, time.into(), at_rest, |frame, row| changes(frame.log_scale, row)).map(|value| value as f32)
    }

    fn rotation(&self, piece: &Piece, time: f32) -> DQuat {
        let index = piece.source as usize;
        let at_rest = self.whole.rotation[index];
        let [w, x, y, z] = self.at(index, time.into(), at_rest, |frame, row| changes(frame.rotation, row));
        let unit = DVec4::new(x, y, z, w).try_normalize();
        let [w, x, y, z] = at_rest.map(f64::from);
        DQuat::from_vec4(unit.unwrap_or_else(|| DVec4::new(x, y, z, w).normalize_or(DVec4::W)))
    }

    /// Removes Gaussians that cannot be drawn at rest or in a frame.
    fn keep_drawable(&mut self) -> Option<String> {
        let frames = self.frames;
        self.whole.mean.par_iter_mut().enumerate().for_each(|(row, mean)| {
            if !frames.iter().all(|frame| frame.is_finite(row)) {
                *mean = [f32::NAN; 3];
            }
        });
        self.rows = (0..self.whole.len()).collect();
        keep_drawable_and(&mut self.whole, |kept| self.rows = kept.to_vec())
    }

    /// Returns a sentence about rotations and scales that change.
    fn statement(&self, pieces: &[Piece]) -> Option<String> {
        if self.frames.iter().all(|frame| frame.rotation.is_none() && frame.log_scale.is_none()) {
            return None;
        }
        let (mut angle, mut scale) = (0.0_f64, 0.0_f32);
        for (piece, time) in pieces.iter().flat_map(|piece| piece.times.map(|time| (piece, time))) {
            angle = angle.max(self.rotation(piece, piece.middle()).angle_between(self.rotation(piece, time)));
            let (own, other) = (self.log_scale(piece, piece.middle()), self.log_scale(piece, time));
            scale = own.iter().zip(other).map(|(own, other)| (own - other).abs()).fold(scale, f32::max);
        }
        let (angle, factor) = (angle.to_degrees(), scale.exp());
        Some(format!(
            "The rotation and the scales of a piece are constant: those at its middle. At its ends they differ by at most {angle:.1} degrees \
             and a factor of {factor:.3}."
        ))
    }
}

/// Converts Gaussians with frames of motion.
///
/// # Errors
/// Invalid options; more than 65 536 frames.
pub(super) fn imported(
    whole: Columns,
    frames: &[Frame<'_>],
    up: UpAxis,
    options: &ReadOptions,
    mut lost: Vec<String>,
) -> Result<Imported, ImportError> {
    let played = played(frames.len(), up, options, &mut lost)?;
    let steps = frames.len().saturating_sub(1).max(1);
    let segments = u32::try_from(steps).ok().filter(|&steps| steps <= MAX_SEGMENTS).ok_or_else(|| {
        ImportError::unsupported(format!("has {} frames, and at most {} are read", frames.len(), MAX_SEGMENTS + 1))
    })?;
    let splitting = splitting(&played, options, segments, Bends::AtSegments)?;
    let mut animated = Animated { whole, frames, rows: Vec::new(), interval: splitting.interval.map(f64::from) };
    lost.extend(animated.keep_drawable());
    let (animated, count) = (&animated, animated.whole.len());
    let pieces = splitting.split(count, |index| {
        let scale = middle_scale(animated.whole.log_scale[index]);
        let position = move |time| animated.mean(index, time);
        Curve { position, mean_t: 0.0, sigma_t: f32::INFINITY, window: ALWAYS, scale }
    });
    lost.extend(statements(&pieces, count, splitting.tolerance));
    lost.extend(animated.statement(&pieces.pieces));
    let log_scale = pieces.pieces.iter().map(|piece| animated.log_scale(piece, piece.middle())).collect();
    let columns = in_pieces(&animated.whole, &vec![f32::INFINITY; count], pieces, |piece| {
        let DQuat { x, y, z, w } = animated.rotation(piece, piece.middle());
        [w, x, y, z].map(|value| value as f32)
    });
    Ok(Imported { scene: Columns { log_scale, ..columns }.into_scene(played, options)?, lost })
}

/// Returns how frames are played: from the first to the last at even steps.
fn played(frames: usize, up: UpAxis, options: &ReadOptions, lost: &mut Vec<String>) -> Result<Played, ImportError> {
    let fps = options.fps.unwrap_or(FPS);
    let span = frames.saturating_sub(1).max(1) as f32 / fps;
    if !span.is_normal() {
        let reason = format!("{frames} frames last {span} seconds");
        return Err(InvalidOption { name: "fps", reason }.into());
    }
    lost.extend(assumed::speed(frames, options));
    let duration_seconds = if frames > 1 { span } else { 0.0 };
    Ok(Played { time_interval: [0.0, span], duration_seconds, ..Played::still(up) })
}
