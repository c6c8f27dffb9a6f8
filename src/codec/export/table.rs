//! The table of the formats of other makes that captures are exported to.
//!
//! In: an id or an extension. Out: an [`Export`], with the function that writes its files from [`Columns`], which have
//! neither packed records nor harmonics in time. A further format is a file in this folder and a row of [`EXPORTS`].

use super::clip::Clip;
use super::error::ExportError;
use super::{fourdgs, gltf, ply, sog, splat, spz, usd};
use crate::codec::import::columns::Columns;
use std::io::{self, Write};

/// A format to export to: a row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Export {
    /// One word for the format, the value of `--format`.
    pub id: &'static str,
    /// Description of a file of this format, with article and extension, for messages.
    pub name: &'static str,
    /// Extension of its files, without the first dot: `ply`, `ftgs.ply`.
    pub extension: &'static str,
    /// What a file holds, and the function that writes it.
    pub(crate) what: What,
    /// Whether a file has the coordinates of the capture, with its origin and the axis that points up. Files of other
    /// formats that have an axis of their own are rotated to it.
    pub(crate) has_space: bool,
    /// Whether a file states that the capture was trained with the filter of Mip-Splatting.
    pub(crate) has_mip_filter: bool,
    /// The farthest coordinate in a file of some Gaussians, capture units; those beyond are left out. `None`: all fit.
    pub(crate) farthest: Option<fn(&Columns) -> f32>,
    /// What the format cannot hold, whatever the capture: one sentence each.
    pub lost: &'static [&'static str],
}

/// What a file of a format holds, and the function that writes it.
#[derive(Debug, Clone, Copy)]
pub(crate) enum What {
    /// The Gaussians at one time, at rest: [`Columns`] without motion and filter, as `instant::at` returns them.
    Instant(Writer),
    /// All Gaussians with [`Motion`](crate::codec::import::columns::Motion), without a filter, as `moving::moving`
    /// returns them. Captures whose Gaussians only a filter switches on and off are refused before.
    Moving(Writer),
    /// As `Moving`, with the temporal filter of the capture if it has one: its intervals must be written too.
    Windowed(Writer),
    /// As `Windowed`, encoded before it is written, since only the encoded file shows what it loses.
    Encoded(Encoder),
}

/// Writes the file of a format. Colors have time degree 0, logits of opacities are finite, quaternions are not 0.
pub(crate) type Writer = fn(&Columns, &Clip, &mut dyn Write) -> io::Result<()>;

/// Encodes the file of a format, and returns a sentence for each thing that it does not hold.
pub(crate) type Encoder = fn(&Columns, &Clip) -> Result<(Vec<u8>, Vec<String>), ExportError>;

/// What all formats of the SOG family lose.
const SOG: &str = "Scales and colors have 256 values, rotations 256 for each component, and at most 65,536 sets of coefficients above degree 0 are \
                   kept.";

/// All formats.
pub const EXPORTS: &[Export] = &[
    Export {
        id: "ply",
        name: "a 3DGS PLY (.ply)",
        extension: "ply",
        what: What::Instant(ply::write_instant),
        has_space: true,
        has_mip_filter: true,
        farthest: None,
        lost: &[],
    },
    Export {
        id: "free-time",
        name: "a FreeTimeGS PLY (.ftgs.ply)",
        extension: "ftgs.ply",
        what: What::Moving(ply::write_moving),
        has_space: true,
        has_mip_filter: true,
        farthest: None,
        lost: &["Players of FreeTimeGS have no cut-off: they draw the ends of lifespans that are not drawn here."],
    },
    Export {
        id: "splat",
        name: "a .splat file (.splat)",
        extension: "splat",
        what: What::Instant(splat::write),
        has_space: false,
        has_mip_filter: false,
        farthest: None,
        lost: &[
            "A .splat file has no view-dependent color: the coefficients above degree 0 are left out.",
            "A .splat file has 256 values for each color channel, the opacity and each component of a rotation.",
        ],
    },
    Export {
        id: "spz",
        name: "an SPZ file, version 3 (.spz)",
        extension: "spz",
        what: What::Instant(spz::write),
        has_space: false,
        has_mip_filter: true,
        farthest: Some(spz::farthest),
        lost: &[
            "An SPZ file has 256 values for each color channel, the opacity and each scale, which is from e^-10 to e^5.94.",
            "An SPZ file has 32 values for each coefficient of degree 1 and 16 for each above, from -1 to 1.",
        ],
    },
    Export {
        id: "gltf",
        name: "a binary glTF file (.glb)",
        extension: "glb",
        what: What::Instant(gltf::write),
        has_space: false,
        has_mip_filter: false,
        farthest: None,
        lost: &[],
    },
    Export {
        id: "usd",
        name: "an OpenUSD text file (.usda)",
        extension: "usda",
        what: What::Windowed(usd::write),
        has_space: false,
        has_mip_filter: false,
        farthest: None,
        lost: &[],
    },
    Export {
        id: "sog",
        name: "a SOG of PlayCanvas (.sog)",
        extension: "sog",
        what: What::Instant(sog::write_sog),
        has_space: false,
        has_mip_filter: true,
        farthest: None,
        lost: &[SOG],
    },
    Export {
        id: "sogst",
        name: "a SOG with motion (.sogst)",
        extension: "sogst",
        what: What::Moving(sog::write_sogst),
        has_space: false,
        has_mip_filter: false,
        farthest: None,
        lost: &[SOG, "A .sogst file has 256 times and 256 lifespans; paths stay exact. Its players have no cut-off."],
    },
    Export {
        id: "4dgs",
        name: "a .4dgs file (.4dgs)",
        extension: "4dgs",
        what: What::Encoded(fourdgs::encode),
        has_space: false,
        has_mip_filter: false,
        farthest: None,
        lost: &[],
    },
    Export {
        id: "usd-frame",
        name: "an OpenUSD text file of one time (.frame.usda)",
        extension: "frame.usda",
        what: What::Instant(usd::write),
        has_space: false,
        has_mip_filter: false,
        farthest: None,
        lost: &[],
    },
];

impl Export {
    /// Returns the format with this id.
    pub fn of_id(id: &str) -> Option<&'static Self> {
        EXPORTS.iter().find(|export| export.id == id)
    }

    /// Returns whether its files have motion.
    pub fn is_moving(&self) -> bool {
        !matches!(self.what, What::Instant(_))
    }

    /// Returns the format of a file name: that with the longest extension that the name ends in.
    pub fn of_name(name: &str) -> Option<&'static Self> {
        let name = name.to_lowercase();
        let ends_so = |export: &&Self| {
            name.strip_suffix(export.extension).is_some_and(|stem| stem.len() > 1 && stem.ends_with('.'))
        };
        EXPORTS.iter().filter(ends_so).max_by_key(|export| export.extension.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_exports_have_the_same_id_or_extension() {
        for (index, export) in EXPORTS.iter().enumerate() {
            for other in &EXPORTS[index + 1..] {
                let differ = export.id != other.id && export.extension != other.extension;
                assert!(differ, "{} and {} are told apart", export.name, other.name);
            }
        }
    }

    #[test]
    fn the_longest_extension_of_a_name_decides() {
        let id = |name| Export::of_name(name).map(|export| export.id);
        assert_eq!(id("a.ply"), Some("ply"), "the format of .ply");
        assert_eq!(id("a.b.FTGS.ply"), Some("free-time"), "a longer extension, in any case");
        assert_eq!(id("a.splat"), Some("splat"), "the format of .splat");
        assert_eq!((id("ply"), id(".ply"), id("a.xply")), (None, None, None), "names without the extension");
    }
}
