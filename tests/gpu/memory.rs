//! The memory of a process that draws picture after picture.
//!
//! In: synthetic scenes, drawn at one time after another. Out: proof that a software driver, whose compiled shaders are memory of the process,
//! compiles none after the first pictures. Skipped on hardware.

use crate::support::gpu;
use crate::support::own_process::run_alone;
use crate::support::packed_scene::{BLACK, scene, settings, view};
use crate::support::skip::skip;
use bevy_gs4d::offline::quantize::compress;
use bevy_gs4d::renderer::{Design, Headless};
use bevy_gs4d::scene::RuntimeScene;
use std::fs;

/// Bytes of this process that are code, but of no file: what a driver has compiled.
fn compiled() -> u64 {
    let maps = fs::read_to_string("/proc/self/maps").expect("Linux lists the memory of a process");
    let code = maps.lines().filter_map(|line| {
        let mut words = line.split_whitespace();
        let (range, access) = (words.next()?, words.next()?);
        // Offset, device and inode are before the name of a file.
        if !access.contains('x') || words.nth(3).is_some() {
            return None;
        }
        let (first, end) = range.split_once('-')?;
        Some(u64::from_str_radix(end, 16).ok()? - u64::from_str_radix(first, 16).ok()?)
    });
    code.sum()
}

/// Draws a scene at times of the first half of [0, 1], then at others of the second. Returns the compiled bytes after each half.
fn compiled_in_turn(headless: &mut Headless, scene: &RuntimeScene) -> [u64; 2] {
    let capture = headless.upload(scene).expect("it fits");
    [0.0, 0.5].map(|first| {
        for picture in 0..12 {
            let view = view(first + picture as f32 / 24.0);
            headless.render(&capture, &view, BLACK).expect("it is drawn");
        }
        compiled()
    })
}

#[test]
fn a_software_driver_compiles_nothing_after_the_first_pictures() {
    // The tests beside it would compile at the same time.
    run_alone("memory::a_software_driver_compiles_nothing_after_the_first_pictures", || {
        let Some(mut headless) = gpu::headless() else { return };
        if headless.context().info.device_type != wgpu::DeviceType::Cpu {
            return skip("hardware compiles to memory of its own");
        }
        let (coded, _) = compress(scene(600, 3, 2), &settings(&[16, 8])).expect("it is compressed");
        let scenes = [("sliced", scene(600, 3, 2)), ("coded", coded.into_runtime().expect("drawable"))];
        for design in [Design::Reference, Design::Fast] {
            headless.set_design(design);
            for (name, scene) in &scenes {
                let [before, after] = compiled_in_turn(&mut headless, scene);
                assert!(before > 0, "what is compiled is found");
                assert_eq!(before, after, "{name}, {design:?}: no picture needs a shader of its own");
            }
        }
    });
}
