//! The fields of `meta.json` that the formats of the SOG family share.
//!
//! In: its bytes. Out: a JSON value, of which each format reads its own structures, and the structures that they share.

use crate::codec::import::ImportError;
use crate::codec::json;
use crate::codec::text::printable;
use serde::Deserialize;
use serde_json::Value;

/// The fields that tell the formats apart.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Kind {
    pub version: Option<u64>,
    pub format: Option<String>,
    #[serde(rename = "type")]
    pub name: Option<String>,
    /// Only in a streamed SOG.
    #[serde(rename = "lodLevels")]
    pub levels: Option<u64>,
}

/// The textures of Gaussians at rest, in all formats but SOG of version 1.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Images {
    pub count: u64,
    pub means: Wide,
    pub scales: Coded,
    pub quats: Single,
    pub sh0: Coded,
    #[serde(rename = "shN")]
    pub rest: Option<Palette>,
}

/// Three 16-bit numbers for each Gaussian, linear between limits: low bytes in the first texture, high in the second.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Wide {
    pub mins: [f64; 3],
    pub maxs: [f64; 3],
    pub files: [String; 2],
}

/// Codes of one codebook. The first entry is `null` in some old files.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Coded {
    pub codebook: Vec<Option<f64>>,
    pub files: [String; 1],
}

/// A texture alone.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Single {
    pub files: [String; 1],
}

/// Coefficients of degree 1 and above: a texture of centroids, and one with the index of a centroid for each Gaussian.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Palette {
    pub count: u64,
    pub bands: u32,
    pub codebook: Vec<Option<f64>>,
    pub files: [String; 2],
}

/// Parses the bytes of a JSON file.
///
/// # Errors
/// Bytes that are not JSON.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Value, ImportError> {
    json::parse(bytes).map_err(|reason| unreadable(name, &reason))
}

/// Returns a structure of a parsed file.
///
/// # Errors
/// A field that is missing or has another type.
pub(super) fn part<'v, T: Deserialize<'v>>(name: &str, value: &'v Value) -> Result<T, ImportError> {
    T::deserialize(value).map_err(|error| unreadable(name, &printable(&error.to_string())))
}

fn unreadable(name: &str, reason: &str) -> ImportError {
    ImportError::damaged(format!("its {name} cannot be read: {reason}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_about_a_wrong_field_names_file_and_field() {
        let value = parse("meta.json", br#"{"mins": [0, 0], "maxs": [1, 1, 1], "files": ["a", "b"]}"#).expect("JSON");
        let message = part::<Wide>("meta.json", &value).expect_err("two limits").to_string();
        assert!(message.contains("meta.json") && message.contains("length 2"), "{message}");
        let value = parse("meta.json", br#"{"count": 3}"#).expect("JSON");
        let message = part::<Images>("meta.json", &value).expect_err("no textures").to_string();
        assert!(message.contains("means"), "{message}");
        assert!(parse("meta.json", b"{").is_err(), "cut JSON");
        let message = parse("meta.json", b"{\"count\":\nNaN}").expect_err("no number").to_string();
        assert!(message.starts_with("its meta.json cannot be read: line 2 has NaN"), "{message}");
    }
}
