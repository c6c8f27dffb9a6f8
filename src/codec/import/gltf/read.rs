//! The scene of a glTF file.
//!
//! In: a file and its buffers. Out: one scene with the Gaussians of all nodes, in the space of the file, +Y up, and
//! what of the file it does not show.

use super::accessors::Accessors;
use super::buffers::Buffers;
use super::color::encode;
use super::container::Container;
use super::document::Document;
use super::nodes::placed;
use super::primitive::{ColorSpace, checked, columns, has_log_scales, splats};
use super::work::Work;
use crate::codec::import::Imported;
use crate::codec::import::columns::{Columns, Played, mip_filter_of};
use crate::codec::import::drawable::keep_drawable;
use crate::codec::import::error::ImportError;
use crate::codec::import::placed::place;
use crate::codec::import::source::Source;
use crate::codec::json;
use crate::codec::options::ReadOptions;
use crate::scene::UpAxis;

/// Extensions that a file may require: those that are read, and those that change nothing of Gaussians.
const KNOWN: [&str; 3] =
    ["KHR_gaussian_splatting", "KHR_gaussian_splatting_compression_spz_2", "KHR_mesh_quantization"];

/// As `KNOWN`: beginnings of names.
const HARMLESS: [&str; 3] = ["KHR_materials_", "KHR_texture_", "KHR_lights_"];

/// Reads a file.
///
/// # Errors
/// A file that is damaged, without Gaussians, or requires an unknown extension; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let container = Container::of(source.bytes)?;
    let document: Document = json::parse(container.json)
        .map_err(|reason| ImportError::damaged(format!("the JSON of the glTF file cannot be read: {reason}")))?;
    for name in &document.extensions_required {
        if !KNOWN.contains(&&**name) && !HARMLESS.iter().any(|known| name.starts_with(known)) {
            return Err(ImportError::unsupported(format!(
                "it requires {}, which is not read: export the file without it",
                name.escape_debug()
            )));
        }
    }
    if splats(&document).next().is_none() {
        return Err(ImportError::unsupported(
            "a glTF file without Gaussians: none of its primitives has KHR_gaussian_splatting",
        ));
    }
    let buffers = Buffers::of(&document, container.binary, source.beside)?;
    let accessors = Accessors { document: &document, buffers };
    let mut lost = Vec::new();
    let parts = parts(&accessors, &mut lost)?;
    let filtered = parts.iter().filter(|part| part.mip_filter).count();
    let (mip_filter, mixed) = mip_filter_of(filtered, parts.len(), "primitives");
    lost.extend(mixed);
    let mut columns = Columns { mip_filter, ..joined(parts) };
    lost.extend(keep_drawable(&mut columns));
    Ok(Imported { scene: columns.into_scene(Played::still(UpAxis::PosY), options)?, lost })
}

/// Returns the Gaussians of all nodes, in the space of the scene.
fn parts(accessors: &Accessors<'_>, lost: &mut Vec<String>) -> Result<Vec<Columns>, ImportError> {
    let document = accessors.document;
    let has_log_scales = has_log_scales(accessors)?;
    let (placed, moved) = placed(accessors)?;
    let mut work = Work::of(accessors.buffers.len());
    let mut parts: Vec<Columns> = Vec::new();
    let (mut linear, mut sheared, mut tangential, mut others) = (0, 0, 0, 0);
    for mesh in placed {
        let map = mesh.map;
        let Some(mesh) = document.meshes.get(mesh.mesh) else {
            return Err(ImportError::damaged(format!("mesh {} does not exist", mesh.mesh)));
        };
        for primitive in &mesh.primitives {
            let Some(splatting) = &primitive.extensions.splatting else {
                work.take(1)?;
                others += 1;
                continue;
            };
            if primitive.mode.is_some_and(|mode| mode != 0) {
                return Err(ImportError::damaged("a primitive with Gaussians that are not points"));
            }
            let space = checked(splatting)?;
            let (mut part, part_lost) = columns(primitive, splatting, accessors, has_log_scales, &mut work)?;
            let count = part.len();
            lost.extend(part_lost.into_iter().filter(|sentence| !lost.contains(sentence)).collect::<Vec<_>>());
            if space == ColorSpace::Linear {
                encode(&mut part.harmonics);
                linear += count;
            }
            if splatting.projection.as_deref().is_some_and(|projection| projection != "perspective") {
                tangential += count;
            }
            if !place(&mut part, &map)? {
                sheared += count;
            }
            parts.push(part);
        }
    }
    if parts.is_empty() {
        return Err(ImportError::unsupported("no node of its scene shows a primitive with KHR_gaussian_splatting"));
    }
    let mut state = |before: &str, count: usize, after: &str| {
        if count > 0 {
            lost.push(format!("{before}{count}{after}"));
        }
    };
    state(
        "",
        linear,
        " Gaussians have linear colors; encoded as sRGB and blended so, overlaps look slightly different.",
    );
    state("", sheared, " Gaussians are stretched by their nodes; their view-dependent colors are only rotated.");
    state(
        "",
        tangential,
        " Gaussians are meant for a projection other than perspective, and are drawn in perspective.",
    );
    state("Primitives without Gaussians are left out (", others, ").");
    state("Animations are left out: the nodes that move (", moved, ") have the pose of the first key frame.");
    Ok(parts)
}

/// Returns the Gaussians of all parts, with the highest of their degrees.
fn joined(mut parts: Vec<Columns>) -> Columns {
    if parts.len() == 1
        && let Some(only) = parts.pop()
    {
        return only;
    }
    let count = parts.iter().map(Columns::len).sum();
    let degree = parts.iter().map(|part| part.harmonics.degree).max().unwrap_or(0);
    let mut all = Columns::with_capacity(count, degree);
    parts.into_iter().for_each(|part| all.append(part));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::columns::{SH_C0, logit};
    use crate::codec::import::gltf::is_of;
    use crate::codec::import::source::InMemory;
    use crate::codec::start::Start;
    use crate::scene::{SceneForm, Trained};
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;
    use glam::{DAffine3, DMat3, DQuat, DVec3};
    use serde_json::{Value, json};
    use std::collections::BTreeMap;
    use std::io::Cursor;
    use std::path::Path;

    /// The attributes of two Gaussians: name, shape, numbers of both.
    const ATTRIBUTES: [(&str, &str, &[f32]); 8] = [
        ("POSITION", "VEC3", &[1.0, 2.0, 3.0, -1.0, 0.5, 0.0]),
        ("KHR_gaussian_splatting:ROTATION", "VEC4", &[0.0, 0.6, 0.0, 0.8, 0.1, -0.2, 0.3, 0.9]),
        ("KHR_gaussian_splatting:SCALE", "VEC3", &[0.1, 0.2, 0.0, 0.5, 0.25, 2.0]),
        ("KHR_gaussian_splatting:OPACITY", "SCALAR", &[0.25, 1.0]),
        ("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", &[0.1, 0.2, 0.3, -0.1, -0.2, -0.3]),
        ("KHR_gaussian_splatting:SH_DEGREE_1_COEF_0", "VEC3", &[0.01, 0.02, 0.03, 0.0, 0.0, 0.0]),
        ("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1", "VEC3", &[0.04, 0.05, 0.06, 0.0, 0.0, 0.0]),
        ("KHR_gaussian_splatting:SH_DEGREE_1_COEF_2", "VEC3", &[0.07, 0.08, 0.09, 0.0, 0.0, 0.0]),
    ];

    /// The document and the buffer of a file with one node, whose mesh is both Gaussians.
    fn document() -> (Value, Vec<u8>) {
        let (mut buffer, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
        let mut attributes = serde_json::Map::new();
        for (index, (name, shape, values)) in ATTRIBUTES.into_iter().enumerate() {
            views.push(json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": values.len() * 4}));
            accessors.push(json!({"bufferView": index, "componentType": 5126, "count": 2, "type": shape}));
            attributes.insert(name.to_owned(), json!(index));
            buffer.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        let document = json!({
            "asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_gaussian_splatting"],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{
                "mode": 0,
                "attributes": attributes,
                "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}},
            }]}],
            "buffers": [{"byteLength": buffer.len()}],
            "bufferViews": views,
            "accessors": accessors,
        });
        (document, buffer)
    }

    /// A binary file.
    fn binary(document: &Value, buffer: &[u8]) -> Vec<u8> {
        let mut json = serde_json::to_vec(document).expect("JSON");
        json.resize(json.len().next_multiple_of(4), b' ');
        let number = |number: usize| (number as u32).to_le_bytes();
        let mut file = [&b"glTF"[..], &number(2), &number(28 + json.len() + buffer.len())].concat();
        file.extend([&number(json.len()), &b"JSON"[..], &json, &number(buffer.len()), b"BIN\0", buffer].concat());
        file
    }

    fn imported(file: &[u8], beside: &InMemory) -> Result<Imported, ImportError> {
        read(&Source { bytes: file, beside }, &ReadOptions::default())
    }

    /// Reads the document after a change.
    fn changed(change: impl FnOnce(&mut Value)) -> Result<Imported, ImportError> {
        let (mut document, buffer) = document();
        change(&mut document);
        imported(&binary(&document, &buffer), &InMemory::default())
    }

    fn trained(imported: Imported) -> Trained {
        match imported.scene.form {
            SceneForm::Trained(trained) => trained,
            SceneForm::Ready(_) => panic!("Gaussians at rest are in the trained form"),
        }
    }

    fn refusal(change: impl FnOnce(&mut Value)) -> String {
        changed(change).expect_err("a file that is refused").to_string()
    }

    #[test]
    fn text_and_binary_files_are_read_as_the_same_scene() {
        let (mut document, buffer) = document();
        let expected = imported(&binary(&document, &buffer), &InMemory::default()).expect("a binary file");
        assert_eq!(expected.lost, [""; 0], "nothing is lost");
        let inside = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&buffer));
        let beside = InMemory(BTreeMap::from([("a b.bin".to_owned(), buffer)]));
        for uri in [&inside, inside.trim_end_matches('='), "a%20b.bin"] {
            document["buffers"][0]["uri"] = json!(uri);
            let text = document.to_string();
            let found = imported(text.as_bytes(), &beside).expect("a text file");
            assert_eq!(found, expected, "the same scene from {uri}");
            let start = Start::of(&mut Cursor::new(&text), Path::new("a.json")).expect("memory");
            assert!(is_of(&start), "text that names the extension is recognized");
        }
        document["buffers"][0]["uri"] = json!("../a.bin");
        assert!(imported(document.to_string().as_bytes(), &beside).is_err(), "a buffer outside of the folder");
        let Trained { parameters, harmonics } = trained(expected);
        assert_eq!(parameters.mean[1], [-1.0, 0.5, 0.0], "means");
        assert_eq!(parameters.rotation_l[0], [0.8, 0.0, 0.6, 0.0], "rotations w, x, y, z");
        assert_eq!(parameters.log_scale[1], [0.5_f32.ln(), 0.25_f32.ln(), 2.0_f32.ln()], "logarithms of scales");
        assert_eq!(parameters.log_scale[0][2], -30.0, "a scale of 0 is tiny");
        assert_eq!(parameters.opacity_logit, [logit(0.25), logit(1.0)], "logits of opacities");
        assert_eq!(harmonics.of(0)[3..6], [0.01, 0.02, 0.03], "the first coefficient of degree 1");
    }

    #[test]
    fn gaussians_have_the_transformations_of_their_nodes() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let found = changed(|document| {
            document["nodes"] = json!([
                {"children": [1], "translation": [0.0, 10.0, 0.0], "rotation": [0.0, half, 0.0, half]},
                {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, -2, 0, 1, 0, 0, 1]},
            ]);
        });
        let found = trained(found.expect("a hierarchy"));
        let turn = DQuat::from_xyzw(0.0, half, 0.0, half);
        let parent = DAffine3::from_rotation_translation(turn, DVec3::Y * 10.0);
        let child = DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::new(2.0, 2.0, -2.0)), DVec3::X);
        let Trained { parameters, harmonics } = trained(changed(|_| {}).expect("no transformation"));
        let mut expected = Columns {
            mean: parameters.mean,
            log_scale: parameters.log_scale,
            rotation: parameters.rotation_l,
            opacity_logit: parameters.opacity_logit,
            harmonics,
            ..Columns::default()
        };
        let is_exact = place(&mut expected, &(parent * child)).expect("a valid map");
        assert!(is_exact, "a map that mirrors and scales evenly is exact");
        assert_eq!(found.parameters.mean, expected.mean, "means");
        assert_eq!(found.parameters.mean[0], [-6.0 + 0.0, 14.0, -3.0], "(1, 2, 3) by hand");
        assert_eq!(found.parameters.rotation_l, expected.rotation, "rotations");
        assert_eq!(found.harmonics, expected.harmonics, "colors");
    }

    #[test]
    fn an_uneven_scale_is_stated_and_a_flat_one_refused() {
        let found = changed(|document| document["nodes"][0]["scale"] = json!([1, 2, 1])).expect("an uneven scale");
        assert!(found.lost[0].starts_with("2 Gaussians are stretched"), "stated: {:?}", found.lost);
        let message = refusal(|document| document["nodes"][0]["scale"] = json!([1, 0, 1]));
        assert!(message.contains("flattens"), "the message names the fault: {message}");
    }

    #[test]
    fn primitives_of_different_degrees_are_joined() {
        let found = changed(|document| {
            let mut plain = document["meshes"][0]["primitives"][0].clone();
            let attributes = plain["attributes"].as_object_mut().expect("attributes");
            attributes.retain(|name, _| !name.contains("DEGREE_1"));
            document["meshes"] = json!([document["meshes"][0], {"primitives": [plain]}]);
            document["nodes"] = json!([{"mesh": 1}, {"mesh": 0}]);
            document["scenes"][0]["nodes"] = json!([0, 1]);
        });
        let Trained { parameters, harmonics } = trained(found.expect("two meshes"));
        assert_eq!((parameters.len(), harmonics.degree), (4, 1), "all Gaussians, of the higher degree");
        assert_eq!(harmonics.of(0)[3..], [0.0; 9], "the first mesh has no color of degree 1");
        assert_eq!(harmonics.of(2)[3..6], [0.01, 0.02, 0.03], "the second has");
    }

    #[test]
    fn scales_of_drafts_are_logarithms() {
        // A negative number, here a color, in place of a scale.
        let found = changed(|document| {
            let color = document["accessors"][4]["bufferView"].clone();
            document["accessors"][2]["bufferView"] = color;
        });
        let scales = trained(found.expect("logarithms")).parameters.log_scale;
        assert_eq!(scales, [[0.1, 0.2, 0.3], [-0.1, -0.2, -0.3]], "numbers as they are");
        let found = changed(|document| {
            document["accessors"][2]["componentType"] = json!(5122);
            document["accessors"][2]["count"] = json!(2);
            // 2 of 4 bytes of zero.
            document["accessors"][2]["bufferView"] = json!(5);
            document["accessors"][2]["byteOffset"] = json!(12);
        });
        let scales = trained(found.expect("integers with a sign")).parameters.log_scale;
        assert_eq!(scales, [[0.0; 3]; 2], "zero is the logarithm of 1");
    }

    #[test]
    fn linear_colors_are_encoded_and_stated() {
        let found = changed(|document| {
            let extensions = &mut document["meshes"][0]["primitives"][0]["extensions"];
            extensions["KHR_gaussian_splatting"]["colorSpace"] = json!("lin_rec709_display");
        });
        let found = found.expect("linear colors");
        assert!(found.lost[0].starts_with("2 Gaussians have linear colors"), "stated: {:?}", found.lost);
        let linear = 0.5 + SH_C0 * 0.1;
        let encoded = (1.055 * linear.powf(1.0 / 2.4) - 0.055 - 0.5) / SH_C0;
        let first = trained(found).harmonics.of(0)[0];
        assert!((first - encoded).abs() < 1e-5, "{first}, not {encoded}");
    }

    #[test]
    fn vertex_colors_replace_missing_harmonics() {
        let found = changed(|document| {
            let attributes = document["meshes"][0]["primitives"][0]["attributes"].as_object_mut().expect("attributes");
            attributes.retain(|name, _| !name.contains("SH_") && !name.contains("OPACITY"));
            attributes.insert("COLOR_0".to_owned(), json!(1));
        });
        let found = found.expect("COLOR_0");
        assert!(found.lost[0].contains("COLOR_0"), "stated: {:?}", found.lost);
        let Trained { parameters, harmonics } = trained(found);
        assert!((0.5 + SH_C0 * harmonics.of(1)[2] - 0.3).abs() < 1e-6, "the third channel is the color");
        assert_eq!(parameters.opacity_logit, [logit(0.8), logit(0.9)], "the fourth is the opacity");
    }

    #[test]
    fn an_spz_file_in_a_buffer_is_decoded() {
        let (mut document, mut buffer) = document();
        // Version 2 without gzip: one Gaussian at (1, 0, 0).
        let mut spz = [&b"NGSP"[..], &[2, 0, 0, 0, 1, 0, 0, 0, 0, 12, 0, 0], &[0, 16, 0]].concat();
        spz.extend([0, 0, 0, 0, 0, 0, 128, 255, 0, 0, 160, 160, 160, 127, 127, 127]);
        document["bufferViews"] = json!([{"buffer": 0, "byteOffset": buffer.len(), "byteLength": spz.len()}]);
        buffer.extend(&spz);
        document["buffers"][0]["byteLength"] = json!(buffer.len());
        let extension = json!({"extensions": {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}});
        document["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"] = extension;
        document["extensionsRequired"] = json!(["KHR_gaussian_splatting_compression_spz_2"]);
        let flags = buffer.len() - spz.len() + 14;
        for (flag, mip_filter) in [(0, false), (1, true)] {
            buffer[flags] = flag;
            let found = imported(&binary(&document, &buffer), &InMemory::default()).expect("an SPZ file inside");
            assert_eq!(
                found.scene.trained_with.mip_filter, mip_filter,
                "the filter of Mip-Splatting is that of the file"
            );
            assert_eq!(trained(found).parameters.mean, [[1.0, 0.0, 0.0]], "one Gaussian on the axis");
        }
    }

    #[test]
    fn animated_nodes_stand_at_their_first_key_frame() {
        for (interpolation, row) in [("LINEAR", [1.0, 2.0, 3.0]), ("CUBICSPLINE", [-1.0, 0.5, 0.0])] {
            let found = changed(|document| {
                // The positions of the Gaussians are also key frames.
                document["animations"] = json!([{
                    "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                    "samplers": [{"input": 3, "output": 0, "interpolation": interpolation}],
                }]);
            });
            let found = found.expect("an animation");
            assert!(found.lost[0].starts_with("Animations are left out"), "stated: {:?}", found.lost);
            let expected = [1.0 + row[0], 2.0 + row[1], 3.0 + row[2]];
            assert_eq!(trained(found).parameters.mean[0], expected, "{interpolation}");
        }
    }

    #[test]
    fn unsupported_and_missing_parts_are_refused_by_name() {
        type Change = fn(&mut Value);
        let cases: [(&str, Change); 12] = [
            ("customShape", |document| {
                let own = &mut document["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"];
                own["kernel"] = json!("customShape");
            }),
            ("other_space", |document| {
                let own = &mut document["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"];
                own["colorSpace"] = json!("other_space");
            }),
            ("sparse", |document| document["accessors"][0]["sparse"] = json!({"count": 1})),
            ("EXT_meshopt_compression", |document| {
                document["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {}});
            }),
            ("KHR_new", |document| document["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_new"])),
            ("without Gaussians", |document| document["meshes"][0]["primitives"][0]["extensions"] = json!({})),
            ("no node", |document| document["nodes"][0] = json!({})),
            ("own ancestor", |document| document["nodes"][0]["children"] = json!([0])),
            ("OPACITY", |document| {
                let attributes = document["meshes"][0]["primitives"][0]["attributes"].as_object_mut();
                attributes.expect("attributes").remove("KHR_gaussian_splatting:OPACITY");
            }),
            ("SH_DEGREE_1_COEF_1", |document| {
                let attributes = document["meshes"][0]["primitives"][0]["attributes"].as_object_mut();
                attributes.expect("attributes").remove("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1");
            }),
            ("has 1 rows", |document| document["accessors"][3]["count"] = json!(1)),
            ("overlap", |document| document["bufferViews"][0]["byteStride"] = json!(4)),
        ];
        for (part, change) in cases {
            let message = refusal(change);
            assert!(message.contains(part), "the message names {part}: {message}");
        }
    }

    #[test]
    fn counts_and_lengths_beyond_the_file_are_refused() {
        let places = [
            ("/accessors/0", "count"),
            ("/accessors/5", "byteOffset"),
            ("/bufferViews/7", "byteOffset"),
            ("/bufferViews/7", "byteLength"),
            ("/buffers/0", "byteLength"),
            ("/nodes/0", "mesh"),
        ];
        for (parent, key) in places {
            for huge in [1000_u64, 1 << 31, u64::MAX] {
                let found = changed(|document| document.pointer_mut(parent).expect("a part")[key] = json!(huge));
                assert!(found.is_err(), "{key} of {parent} is {huge}");
            }
        }
    }

    #[test]
    fn a_mesh_that_is_repeated_too_often_is_refused() {
        let found = changed(|document| {
            let nodes: Vec<Value> = (0..800_000).map(|_| json!({"mesh": 0})).collect();
            document["scenes"][0]["nodes"] = (0..nodes.len()).collect();
            document["nodes"] = json!(nodes);
        });
        let message = found.expect_err("1.6 million Gaussians of 2").to_string();
        assert!(message.contains("repeats"), "the message names the fault: {message}");
    }

    #[test]
    fn many_accessors_of_the_same_bytes_are_refused() {
        let (mut document, mut buffer) = document();
        let rows = 20_000;
        let view = json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": rows * 12});
        document["bufferViews"].as_array_mut().expect("a list").push(view);
        buffer.resize(buffer.len() + rows * 12, 0);
        document["buffers"][0]["byteLength"] = json!(buffer.len());
        let scale = json!({"bufferView": 8, "componentType": 5126, "count": rows, "type": "VEC3"});
        let read = |different: usize| {
            let mut document = document.clone();
            let accessors = document["accessors"].as_array_mut().expect("a list");
            let first = accessors.len();
            accessors.extend((0..different).map(|_| scale.clone()));
            let primitive = |index: usize| {
                json!({
                    "attributes": {"KHR_gaussian_splatting:SCALE": first + index % different},
                    "extensions": {"KHR_gaussian_splatting": {}},
                })
            };
            let hidden: Vec<Value> = (0..400).map(primitive).collect();
            document["meshes"] = json!([document["meshes"][0], {"primitives": hidden}]);
            imported(&binary(&document, &buffer), &InMemory::default())
        };
        assert!(read(1).is_ok(), "an accessor of many primitives is read once");
        let message = read(400).expect_err("8 million scales of 20,000").to_string();
        assert!(message.contains("repeats"), "the message names the fault: {message}");
    }

    #[test]
    fn repeated_primitives_without_gaussians_are_counted_too() {
        let message = refusal(|document| {
            let primitives = document["meshes"][0]["primitives"].as_array_mut().expect("a list");
            primitives.resize(6000, json!({}));
            let nodes = vec![json!({"mesh": 0}); 3000];
            document["scenes"][0]["nodes"] = (0..nodes.len()).collect();
            document["nodes"] = json!(nodes);
        });
        assert!(message.contains("repeats"), "the message names the fault: {message}");
    }

    #[test]
    fn a_file_that_is_cut_anywhere_is_refused() {
        let (document, buffer) = document();
        let whole = binary(&document, &buffer);
        for length in 0..whole.len() {
            assert!(imported(&whole[..length], &InMemory::default()).is_err(), "{length} of {} bytes", whole.len());
        }
    }
}
