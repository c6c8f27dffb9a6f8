//! Archives of the SOG family that no exporter writes.
//!
//! In: an exported SOG. Out: the same textures with the `meta.json` of `.sog4d`, TSOG, `.sogst` on curved paths,
//! version 1, and of levels of detail. Textures of motion and of lifespans are copies of others.

use super::exported::exported;
use super::{packed, unpacked};
use serde_json::{Value, json};

const META: &str = "meta.json";

/// A SOG: the value of its `meta.json`, and its textures.
struct Sog {
    meta: Value,
    textures: Vec<(String, Vec<u8>)>,
}

impl Sog {
    fn of(degree: u32) -> Self {
        let mut textures = unpacked(&exported("sog", &[degree])[0]);
        let at = textures.iter().position(|(name, _)| name == META).expect("a SOG has a meta.json");
        let (_, meta) = textures.remove(at);
        Self { meta: serde_json::from_slice(&meta).expect("JSON"), textures }
    }

    /// Returns the archive with some fields replaced, and with copies of textures under other names.
    fn with(&self, fields: Value, copies: &[(&str, &str)]) -> Vec<u8> {
        let mut meta = self.meta.clone();
        let (Some(all), Value::Object(fields)) = (meta.as_object_mut(), fields) else { panic!("objects") };
        all.extend(fields);
        let mut files = vec![(META.to_owned(), meta.to_string().into_bytes())];
        files.extend(self.textures.iter().cloned());
        for (name, from) in copies {
            let (_, texture) = self.textures.iter().find(|(found, _)| found == from).expect("a texture of every SOG");
            files.push(((*name).to_owned(), texture.clone()));
        }
        packed(files)
    }
}

/// Names of the textures of motion, and those that they are copies of.
const MOTION: [(&str, &str); 2] = [("motion_l.webp", "means_l.webp"), ("motion_u.webp", "means_u.webp")];
const TIMES: [(&str, &str); 2] = [("times_l.webp", "means_u.webp"), ("times_u.webp", "scales.webp")];

fn wide(least: f64, most: f64, files: [&str; 2]) -> Value {
    json!({ "mins": vec![least; 3], "maxs": vec![most; 3], "files": files })
}

/// Returns even steps.
fn codebook(least: f64, most: f64) -> Vec<f64> {
    (0..256).map(|code| least + (most - least) * f64::from(code) / 255.0).collect()
}

/// Returns `.sog4d` in both encodings.
pub fn sog4d() -> Vec<Vec<u8>> {
    let fields = |trbf: Value| {
        json!({
            "version": 1, "type": "sog4d", "start": 1.0, "duration": 2.0, "cubemap": null,
            "motion": wide(-1.0, 1.0, ["motion_l.webp", "motion_u.webp"]), "trbf": trbf,
        })
    };
    let coded = json!({
        "encoding": "kmeans", "center_codebook": codebook(1.0, 3.0), "scale_codebook": codebook(-3.0, 0.0),
        "files": ["times_l.webp"],
    });
    let files = ["times_l.webp", "times_u.webp"];
    let linear = json!({
        "encoding": "quantize16", "center_min": 1.0, "center_max": 3.0, "scale_min": -3.0, "scale_max": 0.0,
        "files": files,
    });
    let copies = [MOTION, TIMES].concat();
    vec![Sog::of(0).with(fields(coded), &copies), Sog::of(1).with(fields(linear), &copies)]
}

/// Returns TSOG of frames, and of motion in 8 and in 16 bits.
pub fn tsog() -> Vec<Vec<u8>> {
    let times = ["times_l.webp", "times_u.webp"];
    let fields = |timeline: Value, means: Option<&[&str]>| {
        let velocity =
            |files: &[&str]| json!({ "means": { "mins": vec![[-1.0; 3]], "maxs": vec![[1.0; 3]], "files": files } });
        json!({
            "version": 4,
            "profile": { "id": "org.opsiclear.tsog-playback", "version": 1 },
            "timeline": timeline,
            "temporal": means.map(velocity),
            "fps": 12.0,
            "playback": { "duration": 2.5, "rate": 0.5 },
            "audio": { "file": "sound.ogg" },
        })
    };
    let frames = json!({ "type": 0, "N": 5, "delta": 13107, "files": times });
    let lifespans = json!({ "type": 1, "mins": [0.0, 0.01], "maxs": [1.0, 0.5], "files": times });
    let copies = [MOTION, TIMES].concat();
    vec![
        Sog::of(0).with(fields(frames, None), &copies),
        Sog::of(1).with(fields(lifespans.clone(), Some(&["motion_l.webp", "motion_u.webp"])), &copies),
        Sog::of(0).with(fields(lifespans.clone(), Some(&["motion_u.webp"])), &copies),
        Sog::of(0).with(fields(lifespans, None), &copies),
    ]
}

/// Returns a `.sogst` on curved paths, all of whose Gaussians are in one group.
pub fn curved() -> Vec<u8> {
    let files = ["motion_l.webp", "motion_u.webp"];
    let mut motion = wide(-1.0, 1.0, files);
    motion["degree"] = json!(2);
    let book = |least, most| json!({ "codebook": codebook(least, most) });
    let fields = json!({
        "version": 1, "format": "sogst", "time": { "min": 0.0, "max": 2.0, "fps": 30 },
        "motion": motion, "accel": wide(-1.0, 1.0, files), "cov2d_scale": [1.0, 1.1],
        "trbf": { "center": book(0.0, 2.0), "sigma": book(0.1, 1.0), "files": ["times_l.webp"] },
    });
    Sog::of(1).with(fields, &[MOTION, TIMES].concat())
}

/// Returns a SOG of version 1.
pub fn first() -> Vec<u8> {
    let sog = Sog::of(1);
    let narrow = |least: f64, most: f64, file: &str, channels: usize| {
        let [mins, maxs] = [least, most].map(|value| vec![value; channels]);
        json!({ "mins": mins, "maxs": maxs, "files": [file] })
    };
    let mut means = sog.meta["means"].clone();
    means["shape"] = json!([sog.meta["count"], 3]);
    let fields = json!({
        "version": null, "means": means, "model": "antialiased",
        "scales": narrow(-5.0, -1.0, "scales.webp", 3), "sh0": narrow(-2.0, 2.0, "sh0.webp", 4),
        "shN": { "mins": -1.0, "maxs": 1.0, "files": ["shN_centroids.webp", "shN_labels.webp"] },
    });
    sog.with(fields, &[])
}

/// Returns the archive of a folder with two levels of detail and surroundings.
pub fn streamed() -> Vec<u8> {
    let sog = Sog::of(1);
    let count = sog.meta["count"].as_u64().expect("a number");
    let half = |first: u64| json!({ "file": 0, "offset": first, "count": count / 2 });
    let coarse = json!({ "file": 1, "offset": 0, "count": 2 });
    let lod = json!({
        "version": 1, "lodLevels": 2, "filenames": ["0_0/meta.json", "1_0/meta.json"], "environment": "env/meta.json",
        "tree": { "children": [{ "lods": { "0": half(0), "1": coarse } }, { "lods": { "0": half(count / 2) } }] },
    });
    let mut files = vec![("lod-meta.json".to_owned(), lod.to_string().into_bytes())];
    for folder in ["0_0", "1_0", "env"] {
        files.push((format!("{folder}/{META}"), sog.meta.to_string().into_bytes()));
        files.extend(sog.textures.iter().map(|(name, texture)| (format!("{folder}/{name}"), texture.clone())));
    }
    packed(files)
}
