//! The export of one scene to one format.
//!
//! In: a scene and a format. Out: [`Exporter`], which writes a file for each time, or one with all motion; and what of the scene its files do
//! not show.

use super::clip::Clip;
use super::error::ExportError;
use super::table::{Export, What};
use super::{instant, lost, moving};
use crate::codec::import::columns::Columns;
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
    lost: Vec<String>,
}

impl Exporter {
    /// Prepares a scene for files of a format; `fps` is for formats that count in frames.
    ///
    /// # Errors
    /// A Gaussian that cannot be drawn; a scene that has no equivalent in the format.
    pub fn new(scene: GaussianScene, format: &'static Export, fps: f32) -> Result<Self, ExportError> {
        let scene = scene.unpacked();
        let mut lost = lost::of(&scene);
        let moving = match format.what {
            What::Instant(_) => None,
            What::Moving(_) | What::Windowed(_) => {
                let (columns, own) = moving::moving(&scene, matches!(format.what, What::Windowed(_)))?;
                lost.extend(own);
                Some(columns)
            }
        };
        lost.extend(format.lost.iter().map(|&sentence| sentence.to_owned()));
        let clip = Clip {
            time_interval: scene.trained_with.time_interval,
            duration_seconds: scene.playback.duration_seconds,
            fps,
            up: scene.playback.up,
            marginal_cutoff: scene.trained_with.marginal_cutoff,
        };
        Ok(Self { scene, format, clip, moving, lost })
    }

    /// Returns what of the scene the files do not show: one sentence each.
    pub fn lost(&self) -> &[String] {
        &self.lost
    }

    /// Writes the file of a time, which is in the unit of the scene; the file of all times if the format has motion. Returns its number of Gaussians.
    ///
    /// # Errors
    /// Errors of the writer; a Gaussian that cannot be drawn.
    pub fn write(&self, time: f32, writer: &mut dyn Write) -> io::Result<usize> {
        let at_time;
        let columns = match &self.moving {
            Some(columns) => columns,
            None => {
                at_time = instant::at(&self.scene, time).map_err(io::Error::other)?;
                &at_time
            }
        };
        let (What::Instant(write) | What::Moving(write) | What::Windowed(write)) = self.format.what;
        write(columns, &self.clip, writer)?;
        Ok(columns.len())
    }
}
