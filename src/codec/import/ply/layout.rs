//! The layout of a PLY file: what its properties mean.
//!
//! In: the names of the elements and their properties. Out: a [`Layout`], or an error that names the kind of file.

use super::table::Table;
use crate::codec::import::error::ImportError;

/// What the properties mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layout {
    /// 3DGS and its relatives: Gaussians at rest.
    Splats,
    /// 3DGS in 16 bytes for each Gaussian, of `SuperSplat`.
    Compressed,
    /// `FreeTimeGS`: straight lines, lifespans.
    FreeTime,
    /// The interchange PLY of `.sogst`: straight lines, lifespans.
    Sogst,
    /// The same with an acceleration.
    SogstCurved,
    /// The source of `.sog4d`: straight lines, lifespans.
    Sog4d,
    /// Spacetime Gaussians without a decoder ("lite"): cubic paths, turning.
    Spacetime,
    /// Native 4D Gaussians of `bevy_gaussian_splatting`.
    Rotated,
}

impl Layout {
    /// Returns the layout of a file with these tables.
    ///
    /// # Errors
    /// Gaussians of a kind that is not read; a file that has no Gaussians.
    pub(super) fn of(tables: &[Table<'_>]) -> Result<Self, ImportError> {
        let Some(vertex) = tables.iter().find(|table| table.name == "vertex") else {
            return Err(ImportError::unsupported(
                "is a PLY file without vertices that are plain numbers, so that it has no Gaussians",
            ));
        };
        let has = |names: &[&str]| names.iter().all(|name| vertex.has(name));
        if has(&["packed_position"]) {
            return Ok(Self::Compressed);
        }
        if has(&["rot_r_x", "st"]) {
            return Ok(Self::Rotated);
        }
        if !has(&["rot_0", "scale_0", "opacity"]) {
            return Err(no_gaussians(vertex));
        }
        if !has(&["scale_2"]) {
            return Err(ImportError::unsupported(
                "holds surfels (2DGS: two scales, no scale_2), which have no thickness and are drawn in another way; train the scene as 3DGS, or give \
                 the file a third scale, scale_2, of about -12",
            ));
        }
        if has(&["motion_0", "f_t_0"]) {
            return Err(ImportError::unsupported(
                "holds full Spacetime Gaussians, whose colors come from a network in another file; train them without it (the \"lite\" model), or \
                 export each frame as a 3DGS PLY and open the folder of these",
            ));
        }
        Ok(if has(&["motion_3", "trbf_scale"]) {
            Self::Spacetime
        } else if has(&["motion_0", "trbf_scale"]) {
            Self::Sog4d
        } else if has(&["t_center", "t_sigma"]) {
            if has(&["ax"]) { Self::SogstCurved } else { Self::Sogst }
        } else if has(&["time", "log_duration"]) {
            Self::FreeTime
        } else {
            Self::Splats
        })
    }
}

/// Returns the error about a file of another subject.
fn no_gaussians(vertex: &Table<'_>) -> ImportError {
    let names: Vec<&str> = vertex.names().take(12).collect();
    let what = if vertex.has("x") { "a point cloud or a mesh" } else { "of an unknown kind" };
    let properties = if names.is_empty() { "no properties".to_owned() } else { names.join(", ") };
    ImportError::unsupported(format!(
        "is a PLY file, but {what}: its vertices have {}, and no Gaussians (rot_0, scale_0, opacity); train Gaussians from it first",
        properties.escape_debug()
    ))
}
