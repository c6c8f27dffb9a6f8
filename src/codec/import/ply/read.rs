//! A PLY file of any layout.
//!
//! In: the bytes of a file. Out: its scene; or, for frames of a sequence, its Gaussians at rest.

use super::body::tables;
use super::header::{Comments, Header};
use super::layout::Layout;
use super::table::Table;
use super::{axes, compressed, deltas, moving, origin, rotated, spacetime, splats, unread};
use crate::codec::import::assumed;
use crate::codec::import::columns::{Columns, Played};
use crate::codec::import::cubic;
use crate::codec::import::drawable::keep_drawable;
use crate::codec::import::error::ImportError;
use crate::codec::import::imported::Imported;
use crate::codec::import::source::Source;
use crate::codec::options::ReadOptions;
use crate::gaussian::MARGINAL_CUTOFF;
use crate::scene::{RotationConvention, SceneForm, UpAxis};

/// Reads a file.
///
/// # Errors
/// A file that is damaged or holds no Gaussians, or Gaussians of a kind that has no equivalent here; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    options.check()?;
    let header = Header::read(source.bytes)?;
    let tables = tables(&header, source.bytes)?;
    let layout = Layout::of(&tables)?;
    let vertex = vertex(&tables)?;
    if layout == Layout::Rotated {
        return native(vertex, &header, options);
    }
    let (comments, mut lost) = (&header.comments, Vec::new());
    let mut columns = at_rest(layout, &tables, comments, origin::of_comments(comments)?, &mut lost)?;
    lost.extend(unread::sentences(layout, &header.elements));
    let (motion, played) = match layout {
        Layout::FreeTime => moving::free_time(vertex, comments, options, &mut lost)?,
        Layout::Sogst | Layout::SogstCurved => moving::sogst(vertex, comments, options, &mut lost)?,
        Layout::Sog4d => moving::sog4d(vertex, comments, options, &mut lost)?,
        Layout::Splats | Layout::Compressed | Layout::Rotated => (Vec::new(), Played::still(UpAxis::NegY)),
        Layout::Spacetime => spacetime::lifespans(vertex, options, &mut lost)?,
    };
    let played = Played { up: axes::up(comments).unwrap_or(played.up), ..played };
    let frames = if layout == Layout::Splats { deltas::frames(&tables, vertex.len())? } else { Vec::new() };
    if !frames.is_empty() {
        return deltas::imported(columns, &frames, played.up, options, lost);
    }
    columns.motion = motion;
    if let Some(bends) = spacetime::bends(layout, vertex)? {
        if layout == Layout::Spacetime && !splats::has_plain_colors(vertex) {
            spacetime::decode_colors(&mut columns);
        }
        return cubic::imported(columns, bends, played, options, lost);
    }
    lost.extend(keep_drawable(&mut columns));
    Ok(Imported { scene: columns.into_scene(played, options)?, lost })
}

/// Reads a file whose Gaussians are all at rest, with means relative to the given origin. Also returns the axis that
/// points up, if the file states it.
///
/// # Errors
/// As [`read`]; a file of moving Gaussians.
pub(crate) fn still(
    bytes: &[u8],
    origin: Option<[f64; 3]>,
    lost: &mut Vec<String>,
) -> Result<(Columns, Option<UpAxis>), ImportError> {
    let header = Header::read(bytes)?;
    let tables = tables(&header, bytes)?;
    let layout = Layout::of(&tables)?;
    let is_at_rest = matches!(layout, Layout::Splats | Layout::Compressed);
    if !is_at_rest || !deltas::frames(&tables, vertex(&tables)?.len())?.is_empty() {
        return Err(ImportError::unsupported(
            "holds moving Gaussians, which cannot be a frame of a sequence: open it by itself",
        ));
    }
    let origin = origin.map_or_else(|| origin::of_comments(&header.comments), |origin| Ok(Some(origin)))?;
    let mut columns = at_rest(layout, &tables, &header.comments, origin, lost)?;
    lost.extend(unread::sentences(layout, &header.elements));
    lost.extend(keep_drawable(&mut columns));
    Ok((columns, axes::up(&header.comments)))
}

/// Reads the table of the vertices of a file, of any layout.
///
/// # Errors
/// A file that is damaged, or has no vertices.
pub(crate) fn vertices(bytes: &[u8]) -> Result<Table<'_>, ImportError> {
    let tables = tables(&Header::read(bytes)?, bytes)?;
    vertex(&tables).cloned()
}

fn vertex<'a, 'b>(tables: &'b [Table<'a>]) -> Result<&'b Table<'a>, ImportError> {
    tables.iter().find(|table| table.name == "vertex").ok_or_else(|| ImportError::damaged("has no element vertex"))
}

/// Reads the attributes of Gaussians at rest, which moving ones have too.
fn at_rest(
    layout: Layout,
    tables: &[Table<'_>],
    comments: &Comments,
    origin: Option<[f64; 3]>,
    lost: &mut Vec<String>,
) -> Result<Columns, ImportError> {
    let vertex = vertex(tables)?;
    match layout {
        Layout::Compressed => compressed::columns(tables, vertex, comments, origin, lost),
        _ => splats::columns(vertex, comments, origin, lost),
    }
}

/// Reads native 4D Gaussians into the trained form.
fn native(vertex: &Table<'_>, header: &Header, options: &ReadOptions) -> Result<Imported, ImportError> {
    let mut lost = unread::sentences(Layout::Rotated, &header.elements);
    let (mut trained, origin) = rotated::trained(vertex, origin::of_comments(&header.comments)?, &mut lost)?;
    let convention = options.rotation_convention.unwrap_or_default();
    if convention == RotationConvention::Unflipped {
        trained.parameters.flip_rotations();
    }
    let up = axes::up(&header.comments).unwrap_or(UpAxis::PosZ);
    lost.extend(assumed::duration(moving::UNKNOWN, options));
    let played = Played { duration_seconds: moving::UNKNOWN, marginal_cutoff: MARGINAL_CUTOFF, ..Played::still(up) };
    let mut scene = played.scene(SceneForm::Trained(trained), None, options)?;
    scene.trained_with.rotation_convention = convention;
    scene.trained_with.origin.place = origin;
    Ok(Imported { scene, lost })
}
