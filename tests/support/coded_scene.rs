//! Packed scenes with two color codebooks of fixed values.
//!
//! In: a number of Gaussians, degrees of color. Out: a packed scene as after compression, with two codebooks.

use bevy_gs4d::internal::scene::Bits;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{CodedColors, Form, PackedColors, PackedScene, RuntimeScene, TemporalFilter};

/// Number of codewords of each codebook.
const ENTRIES: usize = 5;

/// Numbers of bits of the packed values.
const BITS: Bits =
    Bits { mean: 12, mean_t: 10, velocity: 9, sigma_t: 8, scale: 9, rotation: 9, opacity: 8, base: 8, escape: 0.05 };

/// Returns a scene of `count` Gaussians with a support filter; `degree` is at least 1.
pub fn coded_scene(count: usize, degree: u32, degree_t: u32) -> RuntimeScene {
    let settings = SynthSettings { count, degree, degree_t, ..SynthSettings::default() };
    let scene = synthesize(&settings).into_runtime().expect("synthetic scenes are valid");
    let sliced = scene.form.as_sliced().expect("sliced");
    let first = |index: usize| sliced.harmonics.of(index)[..3].try_into().expect("red, green and blue");
    let base: Vec<[f32; 3]> = (0..count).map(first).collect();
    let (mut colors, ends) = CodedColors::of_base(degree, degree_t, &base, BITS.base);
    let values = colors.coefficients() * 3 - 3;
    for stage in 0..2 {
        let byte = |i: usize| (((i * 37 + stage * 11) % 255) as u8).cast_signed();
        let entries: Vec<i8> = (0..ENTRIES * values).map(byte).collect();
        let scales: Vec<f32> = (1..=values).map(|i| 0.001 * i as f32).collect();
        let codes: Vec<u16> = (0..count).map(|i| ((i * 7 + stage) % ENTRIES) as u16).collect();
        colors.push_codebook(&entries, &scales, &codes);
    }
    let span = scene.trained_with.time_span();
    let packed = PackedScene::encode(&sliced.gaussians, &BITS, PackedColors::Coded(colors), ends, span);
    let gaussians = (0..count).map(|index| packed.gaussian(index));
    let filter =
        TemporalFilter::support(gaussians, scene.trained_with.time_interval, scene.trained_with.marginal_cutoff, 9);
    RuntimeScene { form: Form::Packed(packed), filter: Some(filter), ..scene }
}
