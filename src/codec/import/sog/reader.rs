//! The reader of the SOG family, which chooses the format by `meta.json`.
//!
//! In: a zip archive or a JSON file. Out: a scene.

use super::files::Files;
use super::meta::{self, Kind};
use super::{sog2, sog4d, sogst, streamed, tsog};
use crate::codec::import::source::Source;
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;
use crate::codec::start::{Start, ZIP};

/// Extensions of its archives, without the dot.
pub(crate) const EXTENSIONS: &[&str] = &["sog", "sogst", "sog4d", "tsog"];

/// Names of the file of a folder that describes the others.
const MAIN: [&str; 2] = ["lod-meta.json", META];
/// Its name in an archive.
const META: &str = "meta.json";

/// Returns whether a file is of the family: an archive with a `meta.json`, or such a file alone, whatever its name.
pub(crate) fn is_of(start: &Start) -> bool {
    if start.bytes.starts_with(ZIP) {
        return start.has_entry(META);
    }
    let is_named = start.extension == "json" && ["\"means\"", "\"codebook\""].iter().any(|key| start.mentions(key));
    let has_means = start.mentions("\"means\"") && start.mentions("\"mins\"");
    start.is_object() && (is_named || has_means || start.mentions("\"lodLevels\""))
}

/// Returns the name of the file that describes the others of a folder; `None` if the folder has no such file.
pub(crate) fn main_file(folder: &Start) -> Option<&'static str> {
    MAIN.into_iter().find(|name| folder.has_entry(name))
}

/// Reads a scene.
///
/// # Errors
/// A format or a version that is not known; a file that is missing or damaged; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let is_archive = source.bytes.starts_with(ZIP);
    let mut files = if is_archive { Files::of_archive(source.bytes)? } else { Files::beside(source.beside, "") };
    let value = if is_archive { meta::parse(META, &files.read(META)?)? } else { meta::parse(META, source.bytes)? };
    let kind: Kind = meta::part(META, &value)?;
    match (kind.format.as_deref(), kind.name.as_deref(), kind.version) {
        _ if kind.levels.is_some() => streamed::read(source.beside, &value, options),
        (Some("sogst"), ..) => sogst::read(&mut files, &value, options),
        (None, Some("sog4d"), _) => sog4d::read(&mut files, &value, options),
        (None, Some("sog4d_multi"), _) => Err(sog4d::several()),
        (None, None, Some(4)) => tsog::read(&mut files, &value, options),
        (None, None, _) => sog2::read(&mut files, &value, options),
        (Some(name), ..) | (None, Some(name), _) => Err(sog4d::unknown(name)),
    }
}
