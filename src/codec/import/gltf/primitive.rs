//! The Gaussians of a primitive.
//!
//! In: a primitive with `KHR_gaussian_splatting`. Out: [`Columns`] in the space of its mesh, with colors as stored.

use super::accessors::{Accessors, Rows};
use super::document::{Document, Primitive, Splatting};
use super::work::Work;
use crate::codec::import::columns::{Columns, coefficient, logit};
use crate::codec::import::error::ImportError;
use crate::codec::import::spz;
use std::collections::BTreeSet;

/// The prefix of the attributes of the extension.
const PREFIX: &str = "KHR_gaussian_splatting:";

/// The work of finding the rows of a primitive, in numbers that could be read in its place.
const PRIMITIVE: usize = 64;

/// The color spaces that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ColorSpace {
    /// Display-referred, sRGB-encoded.
    Encoded,
    /// Linear light.
    Linear,
}

/// Returns the color space of a primitive.
///
/// # Errors
/// A kernel or a color space that is unknown.
pub(super) fn checked(splatting: &Splatting) -> Result<ColorSpace, ImportError> {
    let kernel = splatting.kernel.as_deref().unwrap_or("ellipse");
    if kernel != "ellipse" {
        return Err(ImportError::unsupported(format!(
            "its Gaussians have the kernel \"{}\", and only \"ellipse\" is drawn",
            kernel.escape_debug()
        )));
    }
    match splatting.color_space.as_deref() {
        None | Some("srgb_rec709_display") => Ok(ColorSpace::Encoded),
        Some("lin_rec709_display") => Ok(ColorSpace::Linear),
        Some(other) => Err(ImportError::unsupported(format!(
            "its colors are of the space \"{}\"; srgb_rec709_display and lin_rec709_display are read",
            other.escape_debug()
        ))),
    }
}

/// Returns whether the scales of a file are logarithms, as in drafts of the extension: one of them is negative, or of a
/// type with a sign for integers.
///
/// # Errors
/// Damaged accessors; more of them than the bytes of the file are for.
pub(super) fn has_log_scales(accessors: &Accessors<'_>) -> Result<bool, ImportError> {
    let (mut work, mut seen) = (Work::of(accessors.buffers.len()), BTreeSet::new());
    for primitive in splats(accessors.document) {
        let Some(&scale) = primitive.attributes.get(&name("SCALE")) else { continue };
        let is_compressed = primitive.extensions.splatting.as_ref().is_some_and(|own| own.extensions.spz.is_some());
        if is_compressed || !seen.insert(scale) {
            continue;
        }
        let rows = accessors.rows(scale, "SCALE")?;
        work.take(rows.accessor.count.saturating_mul(3))?;
        let mut is_negative = false;
        rows.read(|_, scale: [f32; 3]| is_negative |= scale.iter().any(|&scale| scale < 0.0))?;
        if is_negative || (rows.is_integer() && rows.is_signed()) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Returns all primitives with Gaussians.
pub(super) fn splats(document: &Document) -> impl Iterator<Item = &Primitive> {
    let primitives = document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    primitives.filter(|primitive| primitive.extensions.splatting.is_some())
}

/// Returns the Gaussians of a primitive, and what they do not show.
///
/// # Errors
/// Attributes that are missing, damaged, or of different lengths; more numbers than `work` has left.
pub(super) fn columns(
    primitive: &Primitive,
    splatting: &Splatting,
    accessors: &Accessors<'_>,
    has_log_scales: bool,
    work: &mut Work,
) -> Result<(Columns, Vec<String>), ImportError> {
    work.take(PRIMITIVE.saturating_add(primitive.attributes.len()))?;
    let numbers = |count: usize, coefficients: usize| count.saturating_mul(11 + coefficients * 3);
    if let Some(compressed) = &splatting.extensions.spz {
        let file = accessors.buffers.view(compressed.buffer_view)?;
        work.take(file.len())?;
        // Viewers omit the conversion to left, up, front that the draft demands: its axes are those of the mesh.
        let (columns, lost) = spz::columns(file)?;
        work.take(numbers(columns.len(), columns.harmonics.coefficients))?;
        return Ok((columns, lost));
    }
    let mut lost = Vec::new();
    let rows = |name: &'static str, own: String| -> Result<Option<Rows<'_>>, ImportError> {
        primitive.attributes.get(&own).map(|&index| accessors.rows(index, name)).transpose()
    };
    let needed = |name: &'static str, own: String| {
        rows(name, own)?.ok_or_else(|| ImportError::damaged(format!("a primitive with Gaussians has no {name}")))
    };
    let position = needed("POSITION", "POSITION".to_owned())?;
    let count = position.accessor.count;
    let fits = |rows: &Rows<'_>| {
        let found = rows.accessor.count;
        let differ = || rows.damaged(&format!("has {found} rows, where POSITION has {count}"));
        if found == count { Ok(()) } else { Err(differ()) }
    };

    // All rows are found before memory is allocated for them.
    let degree = degree(primitive);
    let harmonics = degree.map_or(Ok(Vec::new()), |degree| coefficients(primitive, accessors, degree))?;
    harmonics.iter().try_for_each(fits)?;
    work.take(numbers(count, harmonics.len().max(1)))?;
    let mut columns = Columns::with_capacity(count, degree.unwrap_or(0));
    position.read(|_, mean| columns.mean.push(mean))?;
    let rotation = needed("ROTATION", name("ROTATION"))?;
    fits(&rotation)?;
    rotation.read(|_, [x, y, z, w]| columns.rotation.push([w, x, y, z]))?;
    let scale = needed("SCALE", name("SCALE"))?;
    fits(&scale)?;
    // The logarithm of 0 is replaced later, as in files of other formats.
    scale.read(|_, scale: [f32; 3]| {
        columns.log_scale.push(if has_log_scales { scale } else { scale.map(f32::ln) });
    })?;

    let fallback = rows("COLOR_0", "COLOR_0".to_owned())?;
    let mut opacities = Vec::with_capacity(count);
    match (rows("OPACITY", name("OPACITY"))?, &fallback) {
        (Some(opacity), _) => {
            fits(&opacity)?;
            opacity.read(|_, [opacity]| opacities.push(logit(opacity)))?;
        }
        (None, Some(color)) if color.components == 4 => {
            fits(color)?;
            color.read(|_, [_, _, _, opacity]| opacities.push(logit(opacity)))?;
        }
        (None, _) => return Err(ImportError::damaged("a primitive with Gaussians has no OPACITY")),
    }
    columns.opacity_logit = opacities;

    let stride = columns.harmonics.coefficients * 3;
    let values = &mut columns.harmonics.values;
    values.resize(count * stride, 0.0);
    for (coefficient, rows) in harmonics.iter().enumerate() {
        let at = coefficient * 3;
        rows.read(|row, value: [f32; 3]| values[row * stride + at..][..3].copy_from_slice(&value))?;
    }
    if harmonics.is_empty() {
        let reason = "a primitive with Gaussians has neither SH_DEGREE_0_COEF_0 nor COLOR_0";
        let color = fallback.ok_or_else(|| ImportError::damaged(reason))?;
        fits(&color)?;
        color.read(|row, color: [f32; 3]| values[row * stride..][..3].copy_from_slice(&color.map(coefficient)))?;
        lost.push(format!("{count} Gaussians have no harmonics: their colors are those of COLOR_0."));
    }
    Ok((columns, lost))
}

/// Returns the coefficients of all degrees up to the highest, in their order.
fn coefficients<'a>(
    primitive: &Primitive,
    accessors: &'a Accessors<'_>,
    degree: u32,
) -> Result<Vec<Rows<'a>>, ImportError> {
    let names = (0..=degree).flat_map(|l| (0..=2 * l).map(move |n| format!("SH_DEGREE_{l}_COEF_{n}")));
    let rows = names.map(|own| match primitive.attributes.get(&name(&own)) {
        Some(&index) => accessors.rows(index, &own),
        None => Err(ImportError::damaged(format!("a primitive with Gaussians of degree {degree} has no {own}"))),
    });
    rows.collect()
}

/// Returns the degree of the colors of a primitive; `None` without any coefficient.
fn degree(primitive: &Primitive) -> Option<u32> {
    (0..=3).rev().find(|l| {
        let prefix = name(&format!("SH_DEGREE_{l}_"));
        primitive.attributes.keys().any(|attribute| attribute.starts_with(&prefix))
    })
}

/// Returns the full name of an attribute of the extension.
fn name(attribute: &str) -> String {
    format!("{PREFIX}{attribute}")
}
