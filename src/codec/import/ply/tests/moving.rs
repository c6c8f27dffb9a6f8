//! Gaussians that move and fade by formulas.
//!
//! In: files that the tests write. Out: proof of what is read of them, and of what is said.

use super::{free_time, read, sliced, trained};
use crate::codec::import::columns::{SH_C0, logit};
use crate::codec::import::ply::fixture::{File, read_bytes, refusal};
use crate::codec::options::ReadOptions;
use crate::gaussian::Model;
use crate::scene::{Form, RotationConvention, SceneForm};
use glam::Vec3;

#[test]
fn free_time_gaussians_move_and_fade() {
    let imported = read(&free_time().comment("opacity_floor 1e-4").little());
    assert!(imported.lost[0].contains("0.0001"), "the floor of the opacity is stated: {:?}", imported.lost);
    assert_eq!(imported.scene.trained_with.time_interval, [0.0, 1.0], "normalized times");
    assert_eq!(imported.scene.playback.duration_seconds, 2.0, "60 frames at 30 a second");
    let (gaussians, _) = sliced(imported);
    for (row, gaussian) in gaussians.iter().enumerate() {
        assert_eq!(gaussian.mean_t, row as f32 * 0.4, "the time of {row}");
        assert_eq!(gaussian.sigma_t, (row as f32 - 5.0).exp().max(0.02), "the lifespan of {row}");
        assert_eq!(gaussian.velocity, [1.0, 2.0, row as f32], "the velocity of {row}");
    }
    let faster = ReadOptions { fps: Some(15.0), ..ReadOptions::default() };
    let imported = read_bytes(&free_time().little(), &faster).expect("it can be read");
    assert_eq!(imported.scene.playback.duration_seconds, 4.0, "60 frames at 15 a second");
    assert_eq!(imported.lost, [""; 0], "nothing is assumed");
    let assumed = |file: &File| read(&file.little()).lost.join("\n");
    assert!(assumed(&free_time()).contains("60 frames are played at 30 a second"), "the speed that is assumed");
    let mut unknown = free_time();
    unknown.comments.retain(|comment| !comment.starts_with("n_frames"));
    assert!(assumed(&unknown).contains("1.00 seconds are assumed"), "the duration that is assumed");
    let resting = read(&free_time().comment("use_velocity false").little());
    assert_eq!(sliced(resting).0[2].velocity, [0.0; 3], "velocities are not used");
    assert!(refusal(&free_time().comment("ftgs_version 2").little()).contains("version 2"), "another version");
    assert!(refusal(&free_time().comment("n_frames many").little()).contains("n_frames"), "a comment without a number");
}

#[test]
fn the_envelope_of_sog4d_is_narrower_by_the_root_of_two() {
    let mut file = File::splats(2, 0).with("trbf_center", |_| 1.5).with("trbf_scale", |_| -1.0);
    for axis in 0..3 {
        file = file.with(&format!("motion_{axis}"), |_| axis as f32);
    }
    let imported = read(&file.clone().comment("cfg_args: start=1 duration=2 fps=30.0 sh_degree=0").little());
    assert_eq!(imported.scene.trained_with.time_interval, [1.0, 3.0], "the interval of cfg_args");
    assert_eq!(imported.scene.playback.duration_seconds, 2.0, "in seconds");
    let gaussian = sliced(imported).0[1];
    assert_eq!((gaussian.mean_t, gaussian.velocity), (1.5, [0.0, 1.0, 2.0]), "time and velocity");
    assert!((gaussian.marginal(2.0) - (-(0.5f32 / (-1.0f32).exp()).powi(2)).exp()).abs() < 1e-6, "exp(-(dt/s)^2)");
    let unknown = read(&file.clone().comment("cfg_args: start=1").little());
    assert_eq!(unknown.scene.trained_with.time_interval, [1.0, 2.0], "one second");
    assert!(unknown.lost[0].contains("1.00 seconds are assumed"), "it is stated: {:?}", unknown.lost);
    let bad = file.clone().comment("cfg_args: start=1 duration=-2");
    assert!(refusal(&bad.little()).contains("duration"), "a clip that ends before it begins");
    let curved = (3..9).fold(file, |file, axis| file.with(&format!("motion_{axis}"), |_| 0.0));
    assert!(!refusal(&curved.little()).is_empty(), "cubic paths are another layout");
}

#[test]
fn a_sogst_ply_needs_the_times_of_its_clip() {
    let mut file = File::splats(2, 0).with("t_center", |_| 0.5).with("t_sigma", |_| 0.1);
    for (name, velocity) in [("vx", 1.0), ("vy", 2.0), ("vz", 3.0)] {
        file = file.with(name, move |_| velocity);
    }
    assert!(refusal(&file.little()).contains("sogst.time_min"), "no times");
    let given = ReadOptions { time_interval: Some([0.0, 4.0]), ..ReadOptions::default() };
    let imported = read_bytes(&file.little(), &given).expect("the times are given");
    assert_eq!(imported.scene.trained_with.time_interval, [0.0, 4.0], "the times that are given");
    let imported = read(&file.comment("sogst.time_min 0.5").comment("sogst.time_max 2").little());
    assert_eq!(imported.scene.trained_with.time_interval, [0.5, 2.0], "the times of the comments");
    let gaussian = sliced(imported).0[0];
    assert_eq!((gaussian.velocity, gaussian.sigma_t), ([1.0, 2.0, 3.0], 0.1), "velocity and lifespan");
}

#[test]
fn gaussians_of_ply4d_are_those_of_the_trainer() {
    let mut names: Vec<String> = ["x", "y", "z", "t", "sx", "sy", "sz", "st", "opacity"].map(str::to_owned).into();
    for stem in ["rot", "rot_r"] {
        names.extend(["x", "y", "z", "w"].map(|axis| format!("{stem}_{axis}")));
    }
    names.extend((0..48).flat_map(|k| ["r", "g", "b"].map(|channel| format!("feat_{channel}_{k}"))));
    let rows = vec![(0..names.len()).map(|column| (column as f32 + 1.0) / 200.0).collect()];
    let file = File { comments: Vec::new(), names, rows };
    let imported = read(&file.little());
    assert_eq!(imported.scene.trained_with.marginal_cutoff, 0.05, "the cut-off of the trainer");
    assert_eq!(imported.lost.len(), 1, "{:?}", imported.lost);
    assert!(imported.lost[0].contains("1.00 seconds are assumed"), "the duration that is assumed: {:?}", imported.lost);
    let (parameters, harmonics) = trained(imported);
    assert_eq!(parameters.model(), Model::Rotated4d, "native 4D Gaussians");
    assert_eq!(parameters.log_scale[0][1], (6.0f32 / 200.0).ln(), "scales are logarithms");
    assert_eq!(parameters.log_scale_t[0], (8.0f32 / 200.0).ln(), "the temporal scale too");
    assert_eq!(parameters.opacity_logit[0], logit(9.0 / 200.0), "the opacity is a logit");
    assert_eq!(parameters.rotation_l[0], [10.0, 11.0, 12.0, 13.0].map(|v| v / 200.0), "x is the first component");
    assert_eq!(parameters.rotation_r[0], [14.0, 15.0, 16.0, 17.0].map(|v| v / 200.0), "of the right rotation too");
    assert_eq!((harmonics.degree, harmonics.degree_t), (3, 2), "48 coefficients");
    assert_eq!(harmonics.of(0)[4], file.value("feat_g_1", 0), "coefficients with RGB innermost");
    let unflipped = ReadOptions { rotation_convention: Some(RotationConvention::Unflipped), ..ReadOptions::default() };
    let flipped = trained(read_bytes(&file.little(), &unflipped).expect("it can be read")).0;
    assert_eq!(flipped.rotation_l[0][1], -11.0 / 200.0, "rotations of the other convention are flipped");
}

/// Reads a file and returns the active mean of its only path at some times, and the red coefficient.
fn path(bytes: &[u8], interval: [f32; 2]) -> (Vec<(f32, Vec3)>, f32) {
    let found = read(bytes);
    let SceneForm::Ready(Form::Sliced(sliced)) = &found.scene.form else { panic!("moving Gaussians are sliced") };
    let filter = found.scene.filter.as_ref().expect("pieces have a filter");
    let at = |step: u32| {
        let time = interval[0] + (interval[1] - interval[0]) * step as f32 / 20.0;
        let segment = filter.segment_of(time, interval);
        let active: Vec<usize> =
            (0..sliced.gaussians.len()).filter(|&index| filter.is_active(segment, index)).collect();
        let [index] = active[..] else { panic!("one piece at {time}: {active:?}") };
        (time, sliced.gaussians[index].mean_at(time))
    };
    ((0..=20).map(at).collect(), sliced.harmonics.values[0])
}

#[test]
fn spacetime_gaussians_follow_their_cubic_paths_and_have_plain_colors() {
    let mut file = File::splats(1, 0).with("trbf_center", |_| 0.25).with("trbf_scale", |_| 3.0);
    let factors: Vec<f32> = (0..9).map(|number| (number as f32 - 3.0) * 0.7).collect();
    for (number, &factor) in factors.iter().enumerate() {
        file = file.with(&format!("motion_{number}"), |_| factor);
    }
    for number in 0..4 {
        file = file.with(&format!("omega_{number}"), |_| 0.1);
    }
    let mean = Vec3::new(file.value("x", 0), file.value("y", 0), file.value("z", 0));
    let (found, red) = path(&file.little(), [0.0, 1.0]);
    let largest = (0..3).map(|axis| file.value(&format!("scale_{axis}"), 0).exp()).fold(0.0, f32::max);
    for (time, at) in found {
        let d = time - 0.25;
        let power = |first: usize| Vec3::from_slice(&factors[first..]);
        let expected = mean + power(0) * d + power(3) * d * d + power(6) * d * d * d;
        assert!(at.distance(expected) < 0.25 * largest + 1e-3, "at {time}: {at} is {expected}");
    }
    assert_eq!(red, (file.value("f_dc_0", 0) - 0.5) / SH_C0, "f_dc is the color itself");
}

#[test]
fn an_acceleration_bends_the_paths_of_sogst() {
    let mut file = File::splats(1, 9).comment("sogst.time_min 2").comment("sogst.time_max 4").with("t_center", |_| 3.0);
    file = file.with("t_sigma", |_| 50.0);
    for (name, value) in [("vx", 1.0), ("vy", 0.0), ("vz", 0.5), ("ax", 0.0), ("ay", -9.0), ("az", 0.0)] {
        file = file.with(name, |_| value);
    }
    let mean = Vec3::new(file.value("x", 0), file.value("y", 0), file.value("z", 0));
    let largest = (0..3).map(|axis| file.value(&format!("scale_{axis}"), 0).exp()).fold(0.0, f32::max);
    for (time, at) in path(&file.little(), [2.0, 4.0]).0 {
        let d = time - 3.0;
        let expected = mean + Vec3::new(d, -9.0 * d * d, 0.5 * d);
        assert!(at.distance(expected) < 0.25 * largest + 1e-3, "at {time}: {at} is {expected}");
    }
}
