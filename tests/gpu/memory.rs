//! The memory of a process that draws many pictures.
//!
//! In: synthetic scenes, drawn at many times. Out: proof that a software driver, whose compiled shaders are in the
//! memory of the process, compiles no shader after the first pictures. Skipped on hardware.

use crate::support::gpu;
use crate::support::own_process::run_alone;
use crate::support::packed_scene::{BLACK, scene, settings, view};
use crate::support::skip::skip;
use bevy_gs4d::offline::compress::compress;
use bevy_gs4d::renderer::{Design, Headless};
use bevy_gs4d::scene::RuntimeScene;
use std::fs;

/// Returns the bytes of executable memory of this process without a file: code compiled by a driver.
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

/// Draws a scene at times of the first half of [0, 1], then of the second half. Returns the compiled bytes after each
/// half.
fn compiled_in_turn(headless: &mut Headless, scene: &RuntimeScene) -> [u64; 2] {
    let capture = headless.upload(scene).expect("the scene fits the GPU");
    [0.0, 0.5].map(|first| {
        for picture in 0..12 {
            let view = view(first + picture as f32 / 24.0);
            headless.render(&capture, &view, BLACK).expect("the view is drawn");
        }
        compiled()
    })
}

#[test]
fn a_software_driver_compiles_no_shader_after_the_first_pictures() {
    // In a separate process: other tests compile shaders at the same time.
    run_alone("memory::a_software_driver_compiles_no_shader_after_the_first_pictures", || {
        let Some(mut headless) = gpu::headless() else { return };
        if headless.context().info.device_type != wgpu::DeviceType::Cpu {
            return skip("the compiled code of hardware is not in the memory of the process");
        }
        let (coded, _) = compress(scene(600, 3, 2), &settings(&[16, 8])).expect("compression succeeds");
        let scenes = [("sliced", scene(600, 3, 2)), ("coded", coded.into_runtime().expect("drawable"))];
        for design in [Design::GlobalSort, Design::TileBins] {
            headless.set_design(design);
            for (name, scene) in &scenes {
                let [before, after] = compiled_in_turn(&mut headless, scene);
                assert!(before > 0, "compiled code is found");
                assert_eq!(before, after, "{name}, {design:?}: later pictures compile no shader");
            }
        }
    });
}
