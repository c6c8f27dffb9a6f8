//! Gaussians whose motion is stored frame by frame.
//!
//! In: files that the tests write. Out: proof of what is read of them, and of what is said.

use super::{animated, read, sliced, trained};
use crate::codec::import::ply::fixture::{File, read_bytes, refusal};
use crate::codec::options::ReadOptions;
use crate::gaussian::SliceSettings;
use glam::Vec3;

#[test]
fn frames_of_motion_are_read_as_moving_pieces() {
    let file = File::splats(2, 0).comment("Exported from Brush").comment("Vertical axis: y");
    let still = vec![127, 127, 127];
    let range = [-0.3, 0.3];
    let frames = [
        (range, vec![still.clone(), still.clone()]),
        (range, vec![vec![254, 127, 0], still.clone()]),
        (range, vec![still.clone(), still.clone()]),
    ];
    let bytes = animated(&file, &["x", "y", "z"], &frames);
    let options = ReadOptions { fps: Some(10.0), tolerance: Some(1e-3), ..ReadOptions::default() };
    let imported = read_bytes(&bytes, &options).expect("it can be read");
    assert_eq!(imported.scene.playback.duration_seconds, 0.2, "two steps at ten frames a second");
    assert_eq!(imported.scene.trained_with.time_interval, [0.0, 0.2], "in seconds");
    assert_eq!(imported.lost.len(), 1, "all is read: {:?}", imported.lost);
    assert!(imported.lost[0].contains("2 Gaussians are 3 straight pieces"), "paths in pieces: {:?}", imported.lost);
    let filter = imported.scene.filter.clone().expect("pieces have a filter");
    let (gaussians, _) = sliced(imported);
    for (time, change) in [(0.0, 0.0), (0.05, 0.5), (0.099, 0.99), (0.15, 0.5), (0.2, 0.0)] {
        let segment = filter.segment_of(time, [0.0, 0.2]);
        let active = (0..gaussians.len()).filter(|&index| filter.is_active(segment, index));
        let at: Vec<Vec3> = active.map(|index| gaussians[index].mean_at(time)).collect();
        let rest = [0, 1].map(|row| Vec3::from(["x", "y", "z"].map(|name| file.value(name, row))));
        let expected = [rest[0] + change * Vec3::new(0.3, 0.0, -0.3), rest[1]];
        let is_near = at.len() == 2 && at.iter().zip(expected).all(|(at, expected)| at.distance(expected) < 1e-5);
        assert!(is_near, "at {time}: {at:?}, not {expected:?}");
    }
    let assumed = read(&bytes);
    assert_eq!(assumed.scene.playback.duration_seconds, 2.0 / 30.0, "30 frames a second");
    assert!(assumed.lost[0].contains("3 frames are played at 30 a second"), "it is stated: {:?}", assumed.lost);
}

#[test]
fn frames_of_motion_change_rotations_and_scales() {
    let file = File::splats(1, 0);
    let names = ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];
    let last = [254, 127, 0, 127, 254, 0, 127];
    let frames = [([-1.0, 1.0], vec![vec![127; 7]]), ([-1.0, 1.0], vec![last.to_vec()])];
    let imported = read(&animated(&file, &names, &frames));
    assert!(imported.lost.iter().any(|lost| lost.contains("rotation and the scales")), "stated: {:?}", imported.lost);
    let found = sliced(imported).0[0];
    let mut middle = file;
    for (name, part) in names.iter().zip(last) {
        let column = middle.names.iter().position(|found| found == name).expect("it is there");
        middle.rows[0][column] += 0.5 * (f32::from(part) / 127.0 - 1.0);
    }
    let (parameters, _) = trained(read(&middle.little()));
    let expected = parameters.slice(&SliceSettings::default()).expect("it can be drawn")[0];
    for (found, expected) in found.covariance.iter().zip(expected.covariance) {
        assert!((found - expected).abs() < 1e-4, "halfway between the frames: {found} is {expected}");
    }
}

#[test]
fn frames_of_a_mesh_are_refused() {
    let bytes = animated(&File::splats(2, 0), &["x", "y", "z"], &[([0.0, 1.0], vec![vec![0, 0, 0]; 3])]);
    let message = refusal(&bytes);
    let is_clear =
        ["delta_vertex_00000", "3 points", "2 Gaussians", "3DGS PLY"].iter().all(|part| message.contains(part));
    assert!(is_clear, "the frame, both numbers and the way out: {message}");
}
