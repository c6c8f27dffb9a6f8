//! Binary glTF files (.glb) with `KHR_gaussian_splatting`.
//!
//! In: [`Columns`] at rest. Out: one primitive of points, +Y up, with linear scales as in the ratified extension, and
//! with colors for viewers without the extension.

use super::clip::Clip;
use super::y_up::y_up;
use crate::codec::import::columns::{Columns, SH_C0, sigmoid};
use crate::view::srgb;
use glam::{Vec3, Vec4};
use serde_json::{Value, json};
use std::io::{self, BufWriter, Write};

/// The component type of single-precision numbers.
const FLOAT: u32 = 5126;
/// The component type of bytes without a sign.
const BYTE: u32 = 5121;

/// An attribute: its name, shape, component type, and the bytes of one Gaussian.
struct Attribute<'a> {
    name: String,
    shape: &'static str,
    component: u32,
    width: usize,
    write: Box<dyn Fn(usize, &mut Vec<u8>) + 'a>,
}

/// Writes Gaussians at rest.
///
/// # Errors
/// Errors of the writer; no Gaussian, or more than fit in the 4 GiB of a file.
pub(super) fn write(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let invalid = |reason: &str| io::Error::new(io::ErrorKind::InvalidInput, reason);
    let columns = &*y_up(columns, clip.up)?;
    let count = columns.len();
    if count == 0 {
        return Err(invalid("no Gaussian is drawn at this time, and a glTF file has at least one"));
    }
    let attributes = attributes(columns);
    let gaussian: usize = attributes.iter().map(|attribute| attribute.width).sum();
    let too_large = || invalid("a binary glTF file has at most 4 GiB");
    let length = count.checked_mul(gaussian).and_then(|length| u32::try_from(length).ok()).ok_or_else(too_large)?;
    let mut json = serde_json::to_vec(&document(columns, &attributes, length))?;
    json.resize(json.len().next_multiple_of(4), b' ');
    let json_length = u32::try_from(json.len()).map_err(|_| too_large())?;
    let total = length.checked_add(json_length).and_then(|sum| sum.checked_add(28)).ok_or_else(too_large)?;
    let mut writer = BufWriter::new(writer);
    writer.write_all(b"glTF")?;
    for number in [2, total, json_length, 0x4e4f_534a] {
        writer.write_all(&number.to_le_bytes())?;
    }
    writer.write_all(&json)?;
    for number in [length, 0x004e_4942] {
        writer.write_all(&number.to_le_bytes())?;
    }
    let mut row = Vec::new();
    for attribute in &attributes {
        for index in 0..count {
            row.clear();
            (attribute.write)(index, &mut row);
            writer.write_all(&row)?;
        }
    }
    writer.flush()
}

/// Returns the attributes, each of which takes a multiple of 4 bytes.
fn attributes(columns: &Columns) -> Vec<Attribute<'_>> {
    let own = |name: &str| format!("KHR_gaussian_splatting:{name}");
    let opacity = |index: usize| sigmoid(columns.opacity_logit[index]);
    let mut attributes = vec![
        floats("POSITION".to_owned(), "VEC3", 12, |index, row| put(row, &columns.mean[index])),
        floats(own("ROTATION"), "VEC4", 16, |index, row| {
            let [w, x, y, z] = columns.rotation[index];
            put(row, &Vec4::new(x, y, z, w).normalize_or(Vec4::W).to_array());
        }),
        floats(own("SCALE"), "VEC3", 12, |index, row| put(row, &columns.log_scale[index].map(f32::exp))),
        floats(own("OPACITY"), "SCALAR", 4, move |index, row| put(row, &[opacity(index)])),
        Attribute {
            name: "COLOR_0".to_owned(),
            shape: "VEC4",
            component: BYTE,
            width: 4,
            write: Box::new(move |index, row| {
                let color = Vec3::from_slice(columns.harmonics.of(index)) * SH_C0 + 0.5;
                // Vertex colors are linear light.
                let color = srgb::decode(color.clamp(Vec3::ZERO, Vec3::ONE)).extend(opacity(index));
                row.extend(color.to_array().map(|channel| (channel * 255.0).round().clamp(0.0, 255.0) as u8));
            }),
        },
    ];
    for l in 0..=columns.harmonics.degree {
        for n in 0..=2 * l {
            let at = (l * l + n) as usize * 3;
            let write = move |index: usize, row: &mut Vec<u8>| put(row, &columns.harmonics.of(index)[at..at + 3]);
            attributes.push(floats(own(&format!("SH_DEGREE_{l}_COEF_{n}")), "VEC3", 12, write));
        }
    }
    attributes
}

/// Returns an attribute of single-precision numbers.
fn floats<'a>(
    name: String,
    shape: &'static str,
    width: usize,
    write: impl Fn(usize, &mut Vec<u8>) + 'a,
) -> Attribute<'a> {
    Attribute { name, shape, component: FLOAT, width, write: Box::new(write) }
}

/// Returns the JSON of a file whose binary chunk has the attributes one after the other.
fn document(columns: &Columns, attributes: &[Attribute<'_>], length: u32) -> Value {
    let count = columns.len();
    let (mut offset, mut views, mut accessors) = (0, Vec::new(), Vec::new());
    for (index, attribute) in attributes.iter().enumerate() {
        let size = attribute.width * count;
        views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": size, "target": 34962}));
        let (component, shape) = (attribute.component, attribute.shape);
        accessors.push(json!({"bufferView": index, "componentType": component, "count": count, "type": shape}));
        if component == BYTE {
            accessors[index]["normalized"] = json!(true);
        }
        offset += size;
    }
    let positions = || columns.mean.iter().copied().map(Vec3::from);
    accessors[0]["min"] = json!(positions().fold(Vec3::INFINITY, Vec3::min).to_array());
    accessors[0]["max"] = json!(positions().fold(Vec3::NEG_INFINITY, Vec3::max).to_array());
    let names: serde_json::Map<String, Value> =
        attributes.iter().enumerate().map(|(index, attribute)| (attribute.name.clone(), json!(index))).collect();
    json!({
        "asset": {"version": "2.0", "generator": concat!("bevy_gs4d ", env!("CARGO_PKG_VERSION"))},
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{
            "mode": 0,
            "attributes": names,
            "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}},
        }]}],
        "buffers": [{"byteLength": length}],
        "bufferViews": views,
        "accessors": accessors,
    })
}

/// Appends numbers.
fn put(row: &mut Vec<u8>, values: &[f32]) {
    row.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::export::samples;
    use crate::codec::import::gltf;
    use crate::codec::import::source::{InMemory, Source};
    use crate::codec::options::ReadOptions;
    use crate::scene::{SceneForm, Trained, UpAxis};

    fn read_back(columns: &Columns, up: UpAxis) -> Columns {
        let mut bytes = Vec::new();
        write(columns, &samples::clip(up), &mut bytes).expect("memory");
        let beside = InMemory::default();
        let source = Source { bytes: &bytes, beside: &beside };
        let imported = gltf::read(&source, &ReadOptions::default()).expect("a file");
        assert!(imported.lost.is_empty(), "nothing is lost: {:?}", imported.lost);
        let SceneForm::Trained(Trained { parameters, harmonics }) = imported.scene.form else {
            panic!("Gaussians at rest are in the trained form");
        };
        Columns {
            mean: parameters.mean,
            log_scale: parameters.log_scale,
            rotation: parameters.rotation_l,
            opacity_logit: parameters.opacity_logit,
            harmonics,
            ..Columns::default()
        }
    }

    #[test]
    fn a_file_that_is_read_back_has_the_same_gaussians() {
        for degree in 0..=3 {
            let columns = samples::columns(20, degree);
            samples::assert_alike(
                &read_back(&columns, UpAxis::PosY),
                &columns,
                &samples::Tolerance {
                    mean: 0.0,
                    log_scale: 1e-5,
                    rotation: 1e-5,
                    opacity: 1e-5,
                    color: 0.0,
                    harmonics: 0.0,
                },
            );
        }
    }

    #[test]
    fn another_axis_is_rotated_to_y_with_the_colors() {
        let columns = samples::columns(20, 3);
        let found = read_back(&columns, UpAxis::PosZ);
        for (found, [x, y, z]) in found.mean.iter().zip(&columns.mean) {
            assert_eq!(*found, [*x, *z, -y], "a quarter of a turn about x");
        }
        // Harmonics of degree 1 are -y, z, -x.
        let (found, before) = (found.harmonics.of(5), columns.harmonics.of(5));
        assert_eq!([found[3], found[6], found[9]], [-before[6], before[3], before[9]], "z is now y, and y is -z");
    }

    #[test]
    fn a_file_without_gaussians_is_refused() {
        let refused = write(&samples::columns(0, 0), &samples::clip(UpAxis::PosY), &mut Vec::new());
        assert!(refused.is_err(), "accessors of glTF have at least one row");
    }
}
