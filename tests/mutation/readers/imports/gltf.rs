//! Binary glTF files.
//!
//! In: an exported file. Out: the same, with a hierarchy of nodes, with scales of a draft, and with an SPZ file inside.

use super::exported::exported;
use super::seed::{chunked, chunks};
use serde_json::{Value, json};

/// Returns the files.
pub fn files() -> Vec<Vec<u8>> {
    let mut files = exported("gltf", &[0, 1]);
    let (json, binary) = chunks(&files[1]);
    let (document, binary): (Value, _) = (serde_json::from_slice(json).expect("JSON"), binary.to_vec());

    let mut placed = document.clone();
    placed["nodes"] = json!([
        {"mesh": 0, "children": [1, 2], "scale": [2, 2, 2], "rotation": [0, 0.6, 0, 0.8]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, -2, 0, 1, 2, 3, 1]},
        {"mesh": 0, "translation": [0, 1, 0]},
    ]);
    let channel = json!({"sampler": 0, "target": {"node": 2, "path": "translation"}});
    placed["animations"] = json!([{"channels": [channel], "samplers": [{"input": 0, "output": 0}]}]);
    placed["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["colorSpace"] =
        json!("lin_rec709_display");
    files.push(chunked(&placed.to_string(), &binary));

    let mut draft = binary.clone();
    let scale = &document["meshes"][0]["primitives"][0]["attributes"]["KHR_gaussian_splatting:SCALE"];
    let at = |value: &Value| value.as_u64().expect("a number") as usize;
    let view = &document["bufferViews"][at(&document["accessors"][at(scale)]["bufferView"])];
    let (first, length) = (at(&view["byteOffset"]), at(&view["byteLength"]));
    for four in draft[first..first + length].chunks_exact_mut(4) {
        four.copy_from_slice(&(-3.0f32).to_le_bytes());
    }
    files.push(chunked(&document.to_string(), &draft));

    let spz = exported("spz", &[1]).remove(0);
    let inside = json!({"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}});
    let compressed = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{
            "mode": 0,
            "attributes": {},
            "extensions": {"KHR_gaussian_splatting": {"extensions": inside}},
        }]}],
        "buffers": [{"byteLength": spz.len()}],
        "bufferViews": [{"buffer": 0, "byteLength": spz.len()}],
    });
    files.push(chunked(&compressed.to_string(), &spz));
    files
}
