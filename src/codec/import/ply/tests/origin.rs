//! The origin of places that are far from 0.
//!
//! In: files that the tests write. Out: proof of what is read of them, and of what is said.

use super::{compressed, read, trained};
use crate::codec::import::ply::fixture::{File, refusal};

/// Returns an ASCII file of small Gaussians of 3DGS at these places, which have the type `kind`.
fn placed(kind: &str, places: &[[f64; 3]]) -> String {
    let mut file = File::splats(places.len(), 0);
    let scales: Vec<usize> = (0..file.names.len()).filter(|&column| file.names[column].starts_with("scale")).collect();
    for row in &mut file.rows {
        scales.iter().for_each(|&column| row[column] = -6.0);
    }
    let mut text = String::from_utf8(file.ascii()).expect("text");
    for axis in ["x", "y", "z"] {
        text = text.replace(&format!("property float {axis}\n"), &format!("property {kind} {axis}\n"));
    }
    let (header, body) = text.split_once("end_header\n").expect("a header");
    let row = |(line, [x, y, z]): (&str, &[f64; 3])| {
        let others: Vec<&str> = line.split(' ').skip(3).collect();
        format!("{x} {y} {z} {}\n", others.join(" "))
    };
    let rows: String = body.lines().zip(places).map(row).collect();
    format!("{header}end_header\n{rows}")
}

/// Places on a map, and their middle.
const MAP: [[f64; 3]; 3] =
    [[500_001.05, 5_400_000.5, 310.4], [499_999.25, 5_400_000.7, 309.4], [500_000.45, 5_400_001.1, 309.8]];
const MIDDLE: [f64; 3] = [500_000.0, 5_400_001.0, 310.0];

/// Reads a file, and returns the origin, the means, and the sentences.
fn origin(text: &str) -> ([f64; 3], Vec<[f32; 3]>, Vec<String>) {
    let imported = read(text.as_bytes());
    let (place, lost) = (imported.scene.trained_with.origin.place, imported.lost.clone());
    (place, trained(imported).0.mean, lost)
}

#[test]
fn places_on_a_map_are_relative_to_their_middle() {
    let (place, means, lost) = origin(&placed("double", &MAP));
    assert_eq!(place, MIDDLE, "the middle in whole units");
    for (mean, place) in means.iter().zip(MAP) {
        let expected: [f32; 3] = std::array::from_fn(|axis| (place[axis] - MIDDLE[axis]) as f32);
        assert_eq!(*mean, expected, "no digit of {place:?} is lost");
    }
    assert_eq!(lost.len(), 1, "one sentence: {lost:?}");
    let is_stated = lost[0].contains("(500000, 5400001, 310)") && lost[0].contains("0.5 units");
    assert!(is_stated, "the origin, and the step of single precision: {lost:?}");

    let (place, means, lost) = origin(&placed("float", &MAP));
    assert_eq!(place, MIDDLE, "of single precision, too");
    let expected: [f32; 3] = std::array::from_fn(|axis| (f64::from(MAP[2][axis] as f32) - MIDDLE[axis]) as f32);
    assert_eq!(means[2], expected, "the digits that the file has");
    assert!(lost[0].contains("Digits were lost") && lost[0].contains("0.5 units"), "it is stated: {lost:?}");
}

#[test]
fn places_near_zero_have_no_origin() {
    let near = [[500.0, 0.25, 0.0], [501.0, 1.0, 0.5], [499.0, -1.0, 1.5]];
    let (place, means, lost) = origin(&placed("double", &near));
    assert_eq!((place, lost), ([0.0; 3], Vec::new()), "370 times the radius from 0");
    assert_eq!(means, near.map(|place| place.map(|value| value as f32)), "the places as they are");
    let farther = near.map(|[x, y, z]| [x + 1500.0, y, z]);
    assert_eq!(origin(&placed("double", &farther)).0, [2000.0, 0.0, 1.0], "1500 times the radius from 0");
    let around = |center: f64, other: f64| {
        let mut places: Vec<[f64; 3]> = (0..30).map(|index| [center, f64::from(index) * 0.1, 0.0]).collect();
        places.push([other, 0.0, 0.0]);
        placed("double", &places)
    };
    assert_eq!(origin(&around(0.0, 1e7)).0, [0.0; 3], "a Gaussian far from the others does not count");
    assert_eq!(origin(&around(1e7, 0.0)).0, [1e7, 1.0, 0.0], "nor one at 0");
    let wide: Vec<[f64; 3]> = (0..30).map(|index| [1e7, f64::from(index) * 1e4, 0.0]).collect();
    let (place, _, lost) = origin(&placed("double", &wide));
    assert_eq!(place, [0.0; 3], "a scene of 290,000 units");
    assert!(lost[0].contains("steps of 1 units at 10000000"), "rounded digits are stated: {lost:?}");
}

#[test]
fn a_comment_states_the_origin() {
    let text = placed("double", &MAP).replace("element", "comment gs4d.origin 499999 5400000 0.5\nelement");
    let (place, means, _) = origin(&text);
    assert_eq!(place, [499_999.0, 5_400_000.0, 0.5], "the origin of the comment");
    assert_eq!(
        means[1],
        [0.25, (5_400_000.7_f64 - 5_400_000.0) as f32, (309.4_f64 - 0.5) as f32],
        "means relative to it"
    );
    for bad in ["gs4d.origin 1 2", "gs4d.origin 1 2 x", "gs4d.origin 1 2 inf"] {
        let text = placed("double", &MAP).replace("element", &format!("comment {bad}\nelement"));
        assert!(refusal(text.as_bytes()).contains("gs4d.origin"), "{bad}: no origin");
    }
}

#[test]
fn compressed_places_on_a_map_are_relative_to_their_middle() {
    let mut bytes = compressed(2);
    let start = bytes.windows(11).position(|window| window == b"end_header\n").expect("a header") + 11;
    bytes[start..start + 4].copy_from_slice(&5e6_f32.to_le_bytes());
    bytes[start + 24..start + 28].copy_from_slice(&(5e6_f32 + 2.0).to_le_bytes());
    let imported = read(&bytes);
    assert_eq!(imported.scene.trained_with.origin.place, [5e6, -2.0, -3.0], "the first of two is the middle");
    assert!(imported.lost[0].contains("Digits were lost"), "boxes in single precision: {:?}", imported.lost);
    assert_eq!(trained(imported).0.mean, [[0.0; 3], [2.0, 4.0, 6.0]], "the corners of the box");
}
