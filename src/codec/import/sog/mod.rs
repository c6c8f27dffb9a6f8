//! The SOG family: attributes of Gaussians in lossless WebP textures, and a `meta.json` that describes them.
//!
//! In: a zip archive (`.sog`, `.sogst`, `.sog4d`, `.tsog`), or a `meta.json` or `lod-meta.json` in a folder. Out: a
//! scene.
//!
//! `files` finds the textures, `textures` decodes them, `meta` has the fields of `meta.json` that the formats share,
//! `splats` turns the textures that they share into columns. Each format is one file: `sog2` (Gaussians at rest),
//! `streamed` (several of those, by levels of detail), `sogst`, `sog4d` and `tsog` (moving). `reader` chooses one.

mod files;
mod meta;
mod reader;
mod sog2;
mod sog4d;
mod sogst;
mod splats;
mod streamed;
mod textures;
mod tsog;

pub(crate) use reader::{EXTENSIONS, is_of, main_file, read};
