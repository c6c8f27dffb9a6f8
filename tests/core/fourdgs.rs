//! Files of the conformance suite of the 4dgs format.
//!
//! In: the files in the folder that `GS4D_DATA` names, with what a decoder must find in each. Out: proof that it is found.

use crate::support::data::data;
use crate::support::skip::skip;
use bevy_gs4d::codec::{ReadOptions, load};
use serde_json::Value;
use std::fs;

#[test]
fn files_of_the_conformance_suite_are_read_as_their_descriptions_say() {
    let Some(folder) = data() else { return };
    let folder = folder.join("formats/4dgs");
    let Ok(files) = fs::read_dir(&folder) else { return skip(format!("no {}", folder.display())) };
    let mut count = 0;
    for path in files.map(|file| file.expect("a file").path()) {
        if path.extension().is_none_or(|extension| extension != "4dgs") {
            continue;
        }
        count += 1;
        let name = path.display();
        let text = fs::read_to_string(path.with_extension("json")).expect("a description");
        let said: Value = serde_json::from_str(&text).expect("JSON");
        let found = load(&path, &ReadOptions::default());
        if said.get("refused").is_some() || said["temporalModel"] == "keyframe-delta" {
            let error = found.expect_err("a file that is refused").to_string();
            assert!(error.len() > 40, "{name}: {error}");
            continue;
        }
        let scene = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        let number = |value: &Value| value.as_f64().expect("a number");
        let gaussians: usize = said["gaussianCount"].as_str().and_then(|text| text.parse().ok()).expect("a number");
        assert_eq!(f64::from(scene.playback.duration_seconds), number(&said["durationSec"]), "{name}: its duration");
        if said["objects"]["tracks"].as_array().is_some_and(|tracks| !tracks.is_empty()) {
            assert!(scene.len() > gaussians, "{name}: objects move along curved paths in {} pieces", scene.len());
            continue;
        }
        assert!(
            scene.len() <= gaussians && scene.len() * 10 >= gaussians * 9,
            "{name}: {} of {gaussians}",
            scene.len()
        );
        let runtime = scene.into_runtime().expect("a scene that can be drawn");
        if runtime.len() == gaussians {
            let sum = runtime
                .iter()
                .fold([0.0; 3], |sum, gaussian| [0, 1, 2].map(|axis| sum[axis] + f64::from(gaussian.mean[axis])));
            for (axis, sum) in sum.iter().enumerate() {
                let expected = number(&said["aggregate"]["positionSum"][axis]);
                assert!((sum - expected).abs() < 1e-3, "{name}: {sum} is {expected}");
            }
            let opacity: f64 = runtime.iter().map(|gaussian| f64::from(gaussian.opacity)).sum();
            let expected = number(&said["aggregate"]["opacitySum"]);
            assert!((opacity - expected).abs() < 1e-3 * expected.max(1.0), "{name}: {opacity} is {expected}");
        }
    }
    assert!(count >= 13, "{count} files");
}
