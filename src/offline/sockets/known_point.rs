//! Points of a scene whose tracks are known, on disk.
//!
//! In: the path of a file, such as the `points.json` of a film; the origin of a capture. Out: its [`KnownPoint`]s in
//! the space and at the timestamps of the capture; an error that names the file and the remedy.

use crate::codec::input::read_at_most;
use crate::codec::json;
use crate::codec::text::printable;
use crate::offline::work::FileError;
use crate::scene::{Origin, Socket};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Most bytes of a file: 256 points at 1,000 times have about 25 MB.
const MOST_BYTES: u64 = 32 << 20;
/// Most points of a file, as many as a capture has sockets.
const MOST_POINTS: usize = 256;
/// The remedy of most faults.
const AGAIN: &str = "film the scene again, or give the points.json of another film";

/// A point of a scene, and where it is.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownPoint {
    /// Its name.
    pub name: String,
    /// Times (timestamp units) in ascending order, each with the place of the point (capture space); `None` where it is
    /// not there, or not visible.
    pub track: Vec<(f32, Option<[f32; 3]>)>,
}

/// A file of known points. Times are those of the camera files beside it.
#[derive(Deserialize)]
struct Stored {
    times: Vec<f64>,
    points: BTreeMap<String, Vec<Option<[f64; 3]>>>,
}

impl KnownPoint {
    /// Reads the points of a file, in the order of their names. Places and times are counted from `origin`.
    ///
    /// # Errors
    /// A file that cannot be read, or is no file of known points.
    pub fn read(path: &Path, origin: &Origin) -> Result<Vec<Self>, FileError> {
        let bytes = read_at_most(path, MOST_BYTES).map_err(|error| FileError::at(path, error))?;
        parse(&bytes, origin).map_err(|reason| FileError::at(path, reason))
    }
}

fn parse(bytes: &[u8], origin: &Origin) -> Result<Vec<KnownPoint>, String> {
    if bytes.len() as u64 > MOST_BYTES {
        return Err(format!(
            "has more than {MOST_BYTES} bytes, the most of a file of known points: film fewer points or times"
        ));
    }
    let stored: Stored =
        json::parse(bytes).map_err(|reason| format!("is no file of known points: {reason}; {AGAIN}"))?;
    let times: Vec<f32> = stored.times.iter().map(|time| (time - origin.time) as f32).collect();
    let is_ascending = times.is_sorted_by(|a, b| a < b) && times.iter().all(|time| time.is_finite());
    if times.is_empty() || !is_ascending {
        return Err(format!("its times are not one number or more in ascending order: {AGAIN}"));
    }
    if !(1..=MOST_POINTS).contains(&stored.points.len()) {
        return Err(format!("has {} points, which may be 1 to {MOST_POINTS}: {AGAIN}", stored.points.len()));
    }
    stored.points.into_iter().map(|(name, places)| known(name, &times, &places, origin)).collect()
}

/// Returns a point with its places at these times.
fn known(name: String, times: &[f32], places: &[Option<[f64; 3]>], origin: &Origin) -> Result<KnownPoint, String> {
    let shown = printable(&name);
    if !Socket::is_name(&name) {
        return Err(format!(
            "has a point with the name '{shown}': names are not blank, have at most 256 bytes and no control characters; rename it"
        ));
    }
    if places.len() != times.len() {
        return Err(format!("the point {shown} has {} places for {} times: {AGAIN}", places.len(), times.len()));
    }
    let place =
        |stored: &[f64; 3]| -> [f32; 3] { std::array::from_fn(|axis| (stored[axis] - origin.place[axis]) as f32) };
    let places: Vec<Option<[f32; 3]>> = places.iter().map(|stored| stored.as_ref().map(place)).collect();
    if !places.iter().flatten().flatten().all(|value| value.is_finite()) {
        return Err(format!("the point {shown} has a place beyond the range of single precision: {AGAIN}"));
    }
    Ok(KnownPoint { name, track: times.iter().copied().zip(places).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn points_are_read_from_the_origin_of_the_capture() {
        let file = json!({
            "seconds": [0, 4], "times": [1e9, 1e9 + 0.5],
            "points": { "lantern": [[5e6, 2, 3], null], "gate": [[5e6, 0, 0.25], [5e6 + 1.0, 0, 0.25]] },
        });
        let origin = Origin { place: [5e6, 1.0, 0.0], time: 1e9 };
        let found = parse(file.to_string().as_bytes(), &origin).expect("a file of known points");
        let gate = vec![(0.0, Some([0.0, -1.0, 0.25])), (0.5, Some([1.0, -1.0, 0.25]))];
        let lantern = vec![(0.0, Some([0.0, 1.0, 3.0])), (0.5, None)];
        let expected =
            [("gate", gate), ("lantern", lantern)].map(|(name, track)| KnownPoint { name: name.into(), track });
        assert_eq!(found, expected, "every digit, by name, with the time at which a point is not there");
    }

    #[test]
    fn faults_are_named() {
        let many: BTreeMap<String, [[u8; 3]; 1]> = (0..257).map(|index| (index.to_string(), [[0; 3]])).collect();
        for (file, expected) in [
            (json!([]), "no file of known points"),
            (json!({ "times": [0] }), "missing field `points`"),
            (json!({ "times": [], "points": { "a": [] } }), "ascending order"),
            (json!({ "times": [0, 0], "points": { "a": [null, null] } }), "ascending order"),
            (json!({ "times": [0, 1e300], "points": { "a": [null, null] } }), "ascending order"),
            (json!({ "times": [0], "points": {} }), "has 0 points"),
            (json!({ "times": [0], "points": many }), "has 257 points"),
            (json!({ "times": [0], "points": { "a\u{1b}": [null] } }), "the name 'a\\u{1b}'"),
            (json!({ "times": [0], "points": { "a": [null, [0, 0, 0]] } }), "the point a has 2 places for 1 times"),
            (json!({ "times": [0], "points": { "a": [[0, 1e300, 0]] } }), "beyond the range of single precision"),
            (json!({ "times": [0], "points": { "a": [[0, 1]] } }), "no file of known points"),
        ] {
            let reason = parse(file.to_string().as_bytes(), &Origin::default()).expect_err("it cannot be used");
            assert!(reason.contains(expected), "{expected}: {reason}");
        }
    }

    #[test]
    fn errors_name_the_file_and_long_files_are_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("points.json");
        let refused = || KnownPoint::read(&path, &Origin::default()).expect_err("it cannot be used").to_string();
        let message = refused();
        assert!(message.contains("points.json: "), "no file: {message}");
        std::fs::write(&path, vec![b' '; MOST_BYTES as usize + 1]).expect("the folder can be written to");
        let message = refused();
        assert!(message.contains("points.json: has more than 33554432 bytes"), "the size is limited: {message}");
    }
}
