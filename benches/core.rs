//! CPU benchmarks: slicing, packages, the CPU reference.
//!
//! In: a synthetic scene of 10,000 Gaussians. Out: Criterion's measurements from short runs. `gs4d bench` measures the
//! GPU.

use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::gaussian::SliceSettings;
use bevy_gs4d::internal::reference;
use bevy_gs4d::reference::Layer;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, SceneForm};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, RasterFov, View};
use criterion::{Criterion, Throughput};
use glam::{UVec2, Vec3};
use std::hint::black_box;
use std::io::Cursor;
use std::time::Duration;

const COUNT: usize = 10_000;

fn scene() -> GaussianScene {
    synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() })
}

fn view() -> View {
    let camera = Camera::look_at(Vec3::new(2.2, 1.1, 1.4), Vec3::ZERO, Vec3::Z, 0.8, UVec2::splat(200));
    camera.view(0.5, RasterFov::default())
}

fn write(scene: &GaussianScene) -> Vec<u8> {
    let mut file = Vec::new();
    package::write(&mut file, scene, &WriteSettings::default()).expect("memory can be written to");
    file
}

fn bench_slice(criterion: &mut Criterion) {
    let scene = scene();
    let SceneForm::Trained(trained) = &scene.form else { panic!("synthetic scenes are in the trained form") };
    let mut group = criterion.benchmark_group("gaussian");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.bench_function("slice", |bencher| {
        bencher.iter(|| trained.parameters.slice(black_box(&SliceSettings::default())));
    });
    group.finish();
}

fn bench_package(criterion: &mut Criterion) {
    let scene = scene();
    let file = write(&scene);
    let mut group = criterion.benchmark_group("package");
    group.throughput(Throughput::Bytes(file.len() as u64));
    group.bench_function("write", |bencher| bencher.iter(|| write(black_box(&scene))));
    group.bench_function("read", |bencher| bencher.iter(|| package::read(Cursor::new(black_box(&file[..])))));
    group.finish();
}

fn bench_reference(criterion: &mut Criterion) {
    let scene = scene().into_runtime().expect("a synthetic scene can be drawn");
    let (view, background) = (view(), Background::Color([0.0; 3]));
    let layer = Layer { scene: &scene, view, appearance: Appearance::default() };
    let mut group = criterion.benchmark_group("reference");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.bench_function("project", |bencher| {
        bencher.iter(|| reference::project(black_box(&layer), BlendSpace::Encoded));
    });
    group.bench_function("render", |bencher| bencher.iter(|| reference::render(black_box(&scene), &view, background)));
    group.finish();
}

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .without_plots()
        .configure_from_args();
    bench_slice(&mut criterion);
    bench_package(&mut criterion);
    bench_reference(&mut criterion);
    criterion.final_summary();
}
