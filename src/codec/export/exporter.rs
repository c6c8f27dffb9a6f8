//! The export of one scene to one format.
//!
//! In: a scene and a format. Out: [`Exporter`], which writes a file for each time, or one with all motion; and what of
//! the scene its files do not show.

use super::clip::Clip;
use super::error::ExportError;
use super::table::{Export, What};
use super::{instant, lost, moving};
use crate::codec::import::columns::Columns;
use crate::codec::import::drawable::keep;
use crate::scene::GaussianScene;
use std::io::{self, Write};

/// A scene that is exported to a format.
#[derive(Debug, Clone)]
pub struct Exporter {
    scene: GaussianScene,
    format: &'static Export,
    clip: Clip,
    /// All Gaussians with their motion; `None` if the format has none.
    moving: Option<Columns>,
    /// The file, if only the encoded file shows what it loses.
    encoded: Option<Vec<u8>>,
    lost: Vec<String>,
}

impl Exporter {
    /// Prepares a scene for files of a format; `fps` is for formats that count in frames.
    ///
    /// # Errors
    /// A Gaussian that cannot be drawn; a scene that has no equivalent in the format.
    pub fn new(scene: GaussianScene, format: &'static Export, fps: f32) -> Result<Self, ExportError> {
        let scene = scene.unpacked();
        let mut lost = lost::of(&scene, format);
        let moving = match format.what {
            What::Instant(_) => None,
            What::Moving(_) | What::Windowed(_) | What::Encoded(_) => {
                let (columns, own) = moving::moving(&scene, !matches!(format.what, What::Moving(_)))?;
                lost.extend(own);
                Some(columns)
            }
        };
        lost.extend(left_out(&scene, format)?);
        lost.extend(format.lost.iter().map(|&sentence| sentence.to_owned()));
        let clip = Clip {
            time_interval: scene.trained_with.time_interval,
            duration_seconds: scene.playback.duration_seconds,
            fps,
            up: scene.playback.up,
            marginal_cutoff: scene.trained_with.marginal_cutoff,
        };
        let mut encoded = None;
        if let (What::Encoded(encode), Some(columns)) = (format.what, &moving) {
            let (bytes, own) = encode(columns, &clip)?;
            lost.extend(own);
            encoded = Some(bytes);
        }
        Ok(Self { scene, format, clip, moving, encoded, lost })
    }

    /// Returns what of the scene the files do not show: one sentence each.
    pub fn lost(&self) -> &[String] {
        &self.lost
    }

    /// Writes the file of a time, which is in the unit of the scene; the file of all times if the format has motion.
    /// Returns its number of Gaussians.
    ///
    /// # Errors
    /// Errors of the writer; a Gaussian that cannot be drawn.
    pub fn write(&self, time: f32, writer: &mut dyn Write) -> io::Result<usize> {
        let at_time;
        let columns = match &self.moving {
            Some(columns) => columns,
            None => {
                at_time = within(instant::at(&self.scene, time).map_err(io::Error::other)?, self.format);
                &at_time
            }
        };
        match self.format.what {
            What::Instant(write) | What::Moving(write) | What::Windowed(write) => write(columns, &self.clip, writer)?,
            What::Encoded(_) => writer.write_all(self.encoded.as_deref().unwrap_or_default())?,
        }
        Ok(columns.len())
    }
}

/// Returns the Gaussians that a file of the format holds.
fn within(mut columns: Columns, format: &Export) -> Columns {
    if let Some((_, kept)) = far(&columns, format) {
        keep(&mut columns, &kept);
    }
    columns
}

/// Returns a sentence with the number of Gaussians beyond the farthest coordinate of the format, which are left out;
/// for a moving capture the largest of the numbers at its beginning, middle and end.
fn left_out(scene: &GaussianScene, format: &Export) -> Result<Option<String>, ExportError> {
    if format.farthest.is_none() {
        return Ok(None);
    }
    let [first, last] = scene.trained_with.time_interval;
    let moves = scene.playback.duration_seconds > 0.0;
    let times = if moves { vec![first, 0.5 * (first + last), last] } else { vec![first] };
    let mut most = None;
    for time in times {
        let columns = instant::at(scene, time)?;
        if let Some((limit, kept)) = far(&columns, format) {
            let number = columns.len() - kept.len();
            most = most.max(Some((number, columns.len(), limit as u32)));
        }
    }
    let up_to = if moves { "Up to " } else { "" };
    Ok(most.map(|(number, all, limit)| {
        format!(
            "{up_to}{number} of {all} Gaussians are left out: they are more than {limit} units from the origin along an axis, beyond which {} \
             has too few digits for the others.",
            format.name
        )
    }))
}

/// Returns the farthest coordinate that a file of the format holds, and the Gaussians within; `None` if all are.
fn far(columns: &Columns, format: &Export) -> Option<(f32, Vec<usize>)> {
    let limit = format.farthest?(columns);
    let is_within = |&index: &usize| columns.mean[index].iter().all(|value| value.abs() <= limit);
    let kept: Vec<usize> = (0..columns.len()).filter(is_within).collect();
    (kept.len() < columns.len()).then_some((limit, kept))
}
