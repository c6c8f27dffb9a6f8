//! The table of the file formats of captures.
//!
//! In: the [`Start`] or the name of a file. Out: its [`Format`], with the functions that read and write it. A further
//! format is one new file in this folder or in `import` and one row of [`FORMATS`]. The formats do not use the table.

use super::checkpoint;
use super::error::CodecErrorKind;
use super::import::source::{Beside, Source};
use super::import::{ImportError, Imported, fourdgs, gltf, ksplat, npz, ply, sequence, sog, splat, splatv, spz};
use super::input::Input;
use super::looks;
use super::options::ReadOptions;
use super::package::{self, PackageInfo, WriteSettings};
use super::start::{Start, ZIP};
use crate::scene::GaussianScene;
use std::io::Write;
use std::path::Path;

/// A file format: a row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Format {
    /// One word for a file of this format, for reports.
    pub id: &'static str,
    /// Description of a file of this format, with article and extension, for messages.
    pub name: &'static str,
    /// Extensions of its files, without the dot.
    pub extensions: &'static [&'static str],
    /// Returns whether a file that starts so is of this format.
    pub(crate) is_of: fn(&Start) -> bool,
    /// Reads a scene.
    pub(crate) read: Read,
    /// Writes a scene; `None` if the format is only read.
    pub write: Option<fn(&mut dyn Write, &GaussianScene, &WriteSettings) -> Result<(), CodecErrorKind>>,
    /// Verifies the checksums of a file without building the scene, and returns its header and the damaged sections;
    /// `None` if the files of the format have no sections.
    pub(crate) inspect: Option<fn(Input) -> Result<PackageInfo, CodecErrorKind>>,
}

/// How a format is read.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Read {
    /// From a file that is positioned at its start and has this path, and the other files of its folder.
    File(fn(&mut Input, &Path, &dyn Beside, &ReadOptions) -> Result<Imported, CodecErrorKind>),
    /// From its bytes in memory.
    Bytes(fn(&Source<'_>, &ReadOptions) -> Result<Imported, ImportError>),
    /// From the files of the folder at a path.
    Folder(fn(&Path, &ReadOptions) -> Result<Imported, ImportError>),
}

/// All formats.
pub const FORMATS: &[Format] = &[
    Format {
        id: "checkpoint",
        name: "a checkpoint of the 4DGS trainer, gsplat or nerfstudio (.pth, .pt, .ckpt)",
        extensions: checkpoint::EXTENSIONS,
        is_of: is_checkpoint,
        read: Read::File(read_checkpoint),
        write: None,
        inspect: None,
    },
    Format {
        id: "package",
        name: "a package (.gs4d)",
        extensions: package::EXTENSIONS,
        is_of: is_package,
        read: Read::File(read_package),
        write: Some(write_package),
        inspect: Some(inspect_package),
    },
    Format {
        id: "spz",
        name: "an SPZ file (.spz)",
        extensions: &["spz"],
        is_of: spz::is_of,
        read: Read::Bytes(spz::read),
        write: None,
        inspect: None,
    },
    Format {
        id: "splatv",
        name: "a capture of the player splaTV (.splatv)",
        extensions: splatv::EXTENSIONS,
        is_of: splatv::is_of,
        read: Read::Bytes(splatv::read),
        write: None,
        inspect: None,
    },
    Format {
        id: "sog",
        name: "a SOG (.sog, .sogst, .sog4d, .tsog, or the meta.json or lod-meta.json of one)",
        extensions: sog::EXTENSIONS,
        is_of: sog::is_of,
        read: Read::Bytes(sog::read),
        write: None,
        inspect: None,
    },
    Format {
        id: "4dgs",
        name: "a capture of the 4dgs format (.4dgs)",
        extensions: fourdgs::EXTENSIONS,
        is_of: fourdgs::is_of,
        read: Read::Bytes(fourdgs::read),
        write: None,
        inspect: None,
    },
    Format {
        id: "dynamic-3dgs",
        name: "parameters of Dynamic 3D Gaussians (.npz)",
        extensions: npz::EXTENSIONS,
        is_of: npz::is_of,
        read: Read::Bytes(npz::read),
        write: None,
        inspect: None,
    },
    Format {
        id: "ply",
        name: "a PLY of Gaussians (.ply)",
        extensions: &["ply", "ply4d"],
        is_of: |start| ply::is_ply(&start.bytes),
        read: Read::Bytes(ply::read),
        write: None,
        inspect: None,
    },
    Format {
        id: "sequence",
        name: "a folder of numbered PLY files",
        extensions: &[],
        is_of: |start| sequence::is_sequence(&start.entries),
        read: Read::Folder(sequence::read_folder),
        write: None,
        inspect: None,
    },
    Format {
        id: "gltf",
        name: "a glTF file with Gaussians (.glb or .gltf)",
        extensions: &["glb", "gltf"],
        is_of: gltf::is_of,
        read: Read::Bytes(gltf::read),
        write: None,
        inspect: None,
    },
    Format {
        id: "ksplat",
        name: "a capture of the player GaussianSplats3D (.ksplat)",
        extensions: ksplat::EXTENSIONS,
        is_of: ksplat::is_of,
        read: Read::Bytes(ksplat::read),
        write: None,
        inspect: None,
    },
    // The last row: such a file has no header, so that its numbers alone tell its format.
    Format {
        id: "splat",
        name: "a .splat file (.splat)",
        extensions: splat::EXTENSIONS,
        is_of: splat::is_of,
        read: Read::Bytes(splat::read),
        write: None,
        inspect: None,
    },
];

impl Format {
    /// Returns the format of a file that starts so; `None` if no format does.
    pub(crate) fn of(start: &Start) -> Option<Self> {
        let is_of = |format: &Self| start.is_folder == matches!(format.read, Read::Folder(_)) && (format.is_of)(start);
        FORMATS.iter().copied().find(is_of)
    }

    /// Returns whether a path ends in one of its extensions.
    pub fn is_named(&self, path: &Path) -> bool {
        path.extension()
            .is_some_and(|found| self.extensions.iter().any(|extension| found.eq_ignore_ascii_case(extension)))
    }
}

/// Returns the extensions of the files of all formats, without the dot.
pub fn extensions() -> Vec<&'static str> {
    let mut extensions: Vec<&str> = FORMATS.iter().flat_map(|format| format.extensions).copied().collect();
    extensions.sort_unstable();
    extensions.dedup();
    extensions
}

/// Returns the message about a file of no known format, with what it looks like.
pub(super) fn unknown(start: &Start) -> String {
    let names: Vec<&str> = FORMATS.iter().map(|format| format.name).collect();
    let looks = looks::described(start);
    match names.split_last() {
        Some((last, others)) => format!("neither {} nor {last}: {looks}", others.join(", ")),
        None => looks,
    }
}

/// Returns the message about a folder of no known format.
pub(super) fn unknown_folder() -> String {
    format!(
        "is a folder, but neither of a sequence ({}) nor of a SOG (meta.json or lod-meta.json beside its textures)",
        sequence::NAMES
    )
}

/// Returns whether a file is a checkpoint: a zip archive that has the pickle of a trainer, or that is damaged, so that
/// its error is that of the most frequent archive; or a file of torch before version 1.6.
fn is_checkpoint(start: &Start) -> bool {
    let has_pickle = start.entries.iter().any(|entry| entry.ends_with("data.pkl"));
    let is_archive = start.bytes.starts_with(ZIP) && (start.entries.is_empty() || has_pickle);
    is_archive || checkpoint::is_legacy(&start.bytes)
}

fn is_package(start: &Start) -> bool {
    start.bytes.starts_with(&package::MAGIC)
}

fn read_checkpoint(
    file: &mut Input,
    path: &Path,
    beside: &dyn Beside,
    options: &ReadOptions,
) -> Result<Imported, CodecErrorKind> {
    Ok(checkpoint::read_file(file, path, beside, options)?)
}

fn read_package(
    file: &mut Input,
    _: &Path,
    beside: &dyn Beside,
    options: &ReadOptions,
) -> Result<Imported, CodecErrorKind> {
    Ok(Imported { scene: package::read_with(file, beside, options)?, lost: Vec::new() })
}

fn write_package(
    writer: &mut dyn Write,
    scene: &GaussianScene,
    settings: &WriteSettings,
) -> Result<(), CodecErrorKind> {
    Ok(package::write(writer, scene, settings)?)
}

fn inspect_package(file: Input) -> Result<PackageInfo, CodecErrorKind> {
    Ok(package::inspect(file)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_about_an_unknown_format_names_every_format_and_what_it_is() {
        let expected = "neither a checkpoint of the 4DGS trainer, gsplat or nerfstudio (.pth, .pt, .ckpt), a package (.gs4d), \
                        an SPZ file (.spz), a capture of the player splaTV (.splatv), a SOG (.sog, .sogst, .sog4d, .tsog, or the \
                        meta.json or lod-meta.json of one), a capture of the 4dgs format (.4dgs), parameters of Dynamic 3D Gaussians \
                        (.npz), a PLY of Gaussians (.ply), a folder of numbered PLY files, a glTF file with Gaussians (.glb or .gltf), \
                        a capture of the player GaussianSplats3D (.ksplat) nor a .splat file (.splat): it is empty";
        assert_eq!(unknown(&Start::default()), expected, "every format by name and extension");
    }

    #[test]
    fn no_two_formats_have_the_same_name_or_id() {
        for (index, format) in FORMATS.iter().enumerate() {
            for other in &FORMATS[index + 1..] {
                assert!(format.id != other.id && format.name != other.name, "{} is one format", format.name);
            }
        }
    }
}
