//! The errors of `segments`.
//!
//! In: what is wrong with a segment or a chunk, or the error of a part. Out: [`SegmentsError`], which names the file; a
//! command adds the option that mends it.

use crate::codec::CodecError;
use crate::offline::work::{FileError, Interrupted};
use crate::scene::ChunkTable;
use std::path::PathBuf;

/// What all segments of a capture must have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shared {
    /// The color behind everything.
    Background,
    /// The environment map, or that there is none.
    Environment,
    /// The axis that points up.
    Up,
    /// The marginal at and below which a Gaussian is not drawn.
    Cutoff,
    /// The field of view that shapes splats.
    RasterFov,
    /// The kind of cameras.
    Cameras,
    /// The mean that gives the viewing direction of color.
    ShDirection,
    /// Whether only the first coefficients of color are evaluated, near plane, and filter of Mip-Splatting.
    Training,
    /// The degrees of color.
    Degrees,
    /// The time after which colors that change with time repeat.
    ColorPeriod,
    /// All settings, of chunks of one capture.
    Settings,
    /// The form of the Gaussians, of chunks of one capture.
    Form,
    /// The temporal filter, of chunks of one capture.
    Filter,
}

impl Shared {
    /// Returns its name in a sentence.
    fn name(self) -> &'static str {
        match self {
            Self::Background => "background color",
            Self::Environment => "environment map",
            Self::Up => "up axis",
            Self::Cutoff => "cut-off of the marginal",
            Self::RasterFov => "field of view that shapes splats",
            Self::Cameras => "kind of training cameras",
            Self::ShDirection => "viewing direction of color",
            Self::Training => "training setting (force_sh_3d, near or mip_filter)",
            Self::Degrees => "degree of color",
            Self::ColorPeriod => "time after which its colors repeat",
            Self::Settings => "set of settings",
            Self::Form => "form",
            Self::Filter => "temporal filter",
        }
    }
}

/// Why segments cannot be joined, or a capture cannot be split.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentsError {
    /// No segment is given.
    #[error("there is no segment to join")]
    Nothing,
    /// Packed Gaussians, whose ranges and codebooks are those of their own file.
    #[error(
        "{}: is packed: its values would be rounded twice; name the lossless package that it was made from, and compress \
         the result", .path.display()
    )]
    Packed {
        /// The segment.
        path: PathBuf,
    },
    /// Packed Gaussians whose order is not that of chunk files.
    #[error("{}: is packed, and was not cut into chunks when it was compressed", .path.display())]
    NoRuns {
        /// The capture.
        path: PathBuf,
    },
    /// Packed Gaussians that are drawn at times at which their chunk file is not.
    #[error(
        "{}: was cut into chunks when it was compressed, and Gaussians are drawn at other times since: its cut-off or its \
         temporal filter has changed", .path.display()
    )]
    OtherRuns {
        /// The capture.
        path: PathBuf,
    },
    /// Something that all segments must have in common.
    #[error("{}: its {} is not that of {}", .path.display(), .what.name(), .first.display())]
    Differs {
        /// The segment.
        path: PathBuf,
        /// The first segment.
        first: PathBuf,
        /// What they should have in common.
        what: Shared,
    },
    /// A still, which takes no time.
    #[error("{}: is a still, which lasts 0 seconds: a segment must last", .path.display())]
    Still {
        /// The segment.
        path: PathBuf,
    },
    /// Two segments whose times overlap.
    #[error("{}: its times begin before those of {} end, at {end}", .path.display(), .before.display())]
    Overlap {
        /// The later segment.
        path: PathBuf,
        /// The segment before it.
        before: PathBuf,
        /// The end of the segment before it, timestamp units.
        end: f64,
    },
    /// A segment whose timestamps are of another length than those of the first.
    #[error("{}: a second is another number of timestamp units than in {}", .path.display(), .first.display())]
    Speed {
        /// The segment.
        path: PathBuf,
        /// The first segment.
        first: PathBuf,
    },
    /// A segment that is too short beside the others.
    #[error(
        "{}: is so short beside all segments that the temporal filter has no segment for it: join fewer at once",
        .path.display()
    )]
    Short {
        /// The segment.
        path: PathBuf,
    },
    /// Gaussians that exist in several windows of time, which become one.
    #[error(
        "{}: has Gaussians that exist in several windows of time each, which cannot be joined: join the captures that it \
         was made from", .path.display()
    )]
    Scattered {
        /// The segment.
        path: PathBuf,
    },
    /// A capture that would be cut into more chunk files than an index may have.
    #[error("{}: would be cut into {found} chunk files, more than {}", .path.display(), ChunkTable::MOST_FILES)]
    ManyChunks {
        /// The capture.
        path: PathBuf,
        /// Number of chunk files.
        found: usize,
    },
    /// A sound, which players of one file would have to read before the first picture.
    #[error("{}: carries a sound, which would delay the first picture: in one file it has to be left out", .path.display())]
    Sound {
        /// The capture.
        path: PathBuf,
    },
    /// A sound where that of a capture in chunk files belongs, and that is of no such capture.
    #[error(
        "{}: is a sound without the index of a capture, and players would play it with the chunk files: move it away, or \
         write to another folder", .path.display()
    )]
    OtherSound {
        /// The sound.
        path: PathBuf,
    },
    /// A chunk that is not there.
    #[error("{}: its chunk {name} is missing: all chunks of a capture are needed", .folder.display())]
    Missing {
        /// The folder of the chunks.
        folder: PathBuf,
        /// The name of the chunk.
        name: String,
    },
    /// Chunks of two captures, or one chunk twice.
    #[error(
        "{}: is a chunk of another capture, or named twice: keep the chunks of each capture in a folder of its own",
        .path.display()
    )]
    Mixed {
        /// The chunk.
        path: PathBuf,
    },
    /// A file cannot be used.
    #[error("{0}")]
    File(#[from] FileError),
    /// A file cannot be written.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
