//! The memory of sequences on the GPU.
//!
//! In: a sequence of exported frames, packed. Out: proof that the memory of the device beside the records of the
//! sequence is that of its largest frame. Skipped where there is no GPU, or where the driver does not report its
//! memory.

use crate::support::gpu;
use crate::support::packed_scene::{BLACK, settings};
use crate::support::skip::skip;
use bevy_gs4d::internal::codec::{Export, Exporter};
use bevy_gs4d::internal::codec::{read_bytes, read_frames};
use bevy_gs4d::offline::compress::compress;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use bevy_gs4d::view::{Camera, RasterFov};
use glam::{UVec2, Vec3};
use std::path::Path;

/// Frames, and Gaussians of each frame before those of other times are left out.
const FRAMES: usize = 60;
const COUNT: usize = 3000;
/// What alignment and the counts of blocks of Gaussians may add, bytes.
const SLACK: u64 = 64 << 10;

/// Returns the files of a sequence.
fn frames() -> Vec<(String, Vec<u8>)> {
    let scene = synthesize(&SynthSettings { count: COUNT, degree: 1, ..SynthSettings::default() });
    let format = Export::of_id("ply").expect("an export");
    let exporter = Exporter::new(scene, format, 30.0).expect("a scene that can be exported");
    let frame = |number: usize| {
        let mut file = Vec::new();
        let time = number as f32 / (FRAMES - 1) as f32;
        exporter.write(time, &mut file).expect("memory can be written to");
        (format!("frame_{number:03}.ply"), file)
    };
    (0..FRAMES).map(frame).collect()
}

fn packed(scene: GaussianScene) -> RuntimeScene {
    let scene = scene.into_runtime().expect("the frames can be drawn");
    let (packed, _) = compress(scene, &settings(&[])).expect("the frames can be compressed");
    packed.into_runtime().expect("the packed frames can be drawn")
}

/// Memory of a device that has drawn a scene, bytes.
struct Memory {
    all: u64,
    /// Of these, those of the capture.
    capture: u64,
}

/// Draws a scene at several times on a device of its own. Returns `None` without a GPU, or without its report.
fn memory(scene: &RuntimeScene) -> Option<Memory> {
    let mut headless = gpu::headless()?;
    let capture = headless.upload(scene).expect("the scene fits the GPU");
    let [first, last] = scene.trained_with.time_interval;
    let camera = Camera::look_at(Vec3::new(2.0, -1.5, 1.2), Vec3::ZERO, Vec3::Z, 0.9, UVec2::new(160, 120));
    for part in [0.0, 0.3, 0.6, 0.99] {
        let view = camera.view(first + (last - first) * part, RasterFov::Reference);
        let frame = headless.render(&capture, &view, BLACK).expect("the view is drawn");
        assert!(frame.counts.visible > 0, "splats are visible in every frame");
    }
    let Some(report) = headless.context().device.generate_allocator_report() else {
        skip("the driver does not report its memory");
        return None;
    };
    Some(Memory { all: report.total_allocated_bytes, capture: capture.bytes() })
}

#[test]
fn a_sequence_needs_the_memory_of_its_largest_frame_beside_its_records() {
    let frames = frames();
    let (_, largest) = frames.iter().max_by_key(|(_, file)| file.len()).expect("frames");
    let (largest, _) = read_bytes(Path::new("a.ply"), largest).expect("a frame");
    let (sequence, _) = read_frames(frames.clone()).expect("a sequence");
    let [largest, sequence] = [largest, sequence].map(packed);
    assert!(sequence.len() > FRAMES / 2 * largest.len(), "the frames are of about the same size");
    let (Some(one), Some(all)) = (memory(&largest), memory(&sequence)) else { return };
    let (beside, of_one) = (all.all - all.capture, one.all - one.capture);
    let list = largest.len() as u64 * 4;
    assert!(
        beside <= of_one + list + SLACK,
        "beside its records, the sequence has {beside} bytes, and its largest frame {of_one}"
    );
    assert!(
        all.all <= one.all * 3 / 2 + all.capture,
        "{} bytes are more than one and a half times the {} of the largest frame, and the {} of all records",
        all.all,
        one.all,
        all.capture
    );
}
