//! Captures in post-processing: motion vectors, temporal anti-aliasing, motion blur, depth of field, volumetric fog.
//!
//! In: flat captures made by hand, which are at rest or move by the same distance in each frame. Out: proof that their
//! motion vectors are correct, and that Bevy's effects treat captures as moving surfaces with default camera settings.
//! The tests count frames, so rendering is not pipelined. Skipped without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::scene;
use crate::support::fixtures::{front, insert, spawn};
use crate::support::offscreen_app::{FOV_Y, picture, spawn_camera, unpipelined_app};
use crate::support::spans::has_recorded;
use bevy::anti_alias::taa::TemporalAntiAliasing;
use bevy::core_pipeline::prepass::{DepthPrepass, MotionVectorPrepass, ViewPrepassTextures};
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::light::{FogVolume, VolumetricFog, VolumetricLight};
use bevy::post_process::dof::{DepthOfField, DepthOfFieldMode};
use bevy::post_process::motion_blur::MotionBlur;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureViewSettings, DepthWrite};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::testing::{self, Offscreen};
use std::sync::{Arc, Mutex};

/// Rows of this width have no padding when they are read back.
const SIZE: UVec2 = UVec2::new(64, 48);
/// Frames after which an effect has its final strength.
const FRAMES: u32 = 12;

/// Runs one frame.
fn step(app: &mut App) {
    app.update();
    assert!(app.should_exit().is_none(), "the app draws without an error");
}

/// Returns the size in pixels of one unit at this distance from the camera.
fn pixels_of_unit(distance: f32) -> f32 {
    SIZE.y as f32 / (2.0 * distance * (FOV_Y / 2.0).tan())
}

/// Returns a plane at z = 0 that fills the view of [`front`], with stripes of two grays along y or along x.
fn stripes(along_y: bool) -> RuntimeScene {
    let spots: Vec<(Gaussian, Vec3)> = (-22..=22)
        .flat_map(|column| (-12..=12).map(move |row| (column, row)))
        .map(|(column, row)| {
            let place = Vec3::new(column as f32, row as f32, 0.0) * 0.25;
            let bright = (if along_y { column } else { row }) % 2 == 0;
            (blob(place, Vec3::new(0.12, 0.12, 0.002), 0.98), Vec3::splat(if bright { 0.9 } else { 0.2 }))
        })
        .collect();
    scene(&spots)
}

/// Returns a flat white plane at z = 0 that fills the view of [`front`].
fn white() -> RuntimeScene {
    scene(&[(blob(Vec3::ZERO, Vec3::new(20.0, 20.0, 0.002), 0.98), Vec3::ONE)])
}

/// Motion vectors and prepass depths of the last frame, in a buffer that the host can map.
#[derive(Resource, Clone, Default)]
struct Vectors(Arc<Mutex<Option<(wgpu::Device, wgpu::Buffer)>>>);

const READ_VECTORS: &str = "
@group(0) @binding(0) var vectors: texture_2d<f32>;
@group(0) @binding(1) var depths: texture_depth_2d;
@group(0) @binding(2) var<storage, read_write> found: array<vec4<f32>>;

@compute @workgroup_size(8, 8)
fn read_vectors(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(vectors);
    if all(id.xy < size) {
        found[id.y * size.x + id.x] = vec4(textureLoad(vectors, id.xy, 0).xy, textureLoad(depths, id.xy, 0), 0.0);
    }
}
";

/// Copies the camera's motion vectors and prepass depths by a shader after captures are drawn, since Bevy's textures
/// have no copy usage.
fn read_vectors(
    camera: ViewQuery<&ViewPrepassTextures>,
    device: Res<RenderDevice>,
    vectors: Res<Vectors>,
    mut context: RenderContext,
) {
    let textures = camera.into_inner();
    let (Some(motions), Some(depths)) = (&textures.motion_vectors, &textures.depth) else { return };
    let device = device.wgpu_device();
    let source = wgpu::ShaderSource::Wgsl(READ_VECTORS.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let size = u64::from(SIZE.x * SIZE.y) * 16;
    let buffer =
        |usage| device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false });
    let found = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let copy = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            entry(0, wgpu::BindingResource::TextureView(&motions.texture.default_view)),
            entry(1, wgpu::BindingResource::TextureView(&depths.texture.default_view)),
            entry(2, found.as_entire_binding()),
        ],
    });
    let encoder = context.command_encoder();
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(SIZE.x.div_ceil(8), SIZE.y.div_ceil(8), 1);
    }
    encoder.copy_buffer_to_buffer(&found, 0, &copy, 0, size);
    *vectors.0.lock().expect("the lock is not poisoned") = Some((device.clone(), copy));
}

impl Vectors {
    /// Adds the copy to an app.
    fn of(app: &mut App) -> Self {
        let vectors = Self::default();
        let render_app = app.get_sub_app_mut(RenderApp).expect("a renderer");
        render_app
            .insert_resource(vectors.clone())
            .add_systems(Core3d, read_vectors.after(Core3dSystems::MainPass).before(Core3dSystems::EarlyPostProcess));
        vectors
    }

    /// Returns the motion, as a fraction of the picture, and the depth at a pixel of the last frame.
    fn at(&self, x: u32, y: u32) -> (Vec2, f32) {
        let (device, buffer) = self.0.lock().expect("the lock is not poisoned").take().expect("a frame has been drawn");
        buffer.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.expect("the copy can be mapped"));
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
        let bytes = buffer.slice(..).get_mapped_range().to_vec();
        let first = (y * SIZE.x + x) as usize * 4;
        let value = |i: usize| bytemuck::pod_read_unaligned::<f32>(&bytes[4 * (first + i)..4 * (first + i) + 4]);
        (Vec2::new(value(0), value(1)), value(2))
    }
}

/// Returns one flat Gaussian at the origin that moves with its capture's time.
fn moving(velocity: Vec3) -> RuntimeScene {
    let at_rest = blob(Vec3::ZERO, Vec3::new(1.2, 1.2, 0.002), 0.98);
    scene(&[(Gaussian { velocity: velocity.to_array(), mean_t: 0.0, ..at_rest }, Vec3::ONE)])
}

#[test]
fn motion_vectors_follow_splats_entities_and_cameras() {
    let middle = SIZE / 2;
    // Two seconds are one unit of time.
    let seconds = 0.05;
    let by_time = Vec3::new(8.0, -4.0, 0.0);
    let by_hand = Vec3::new(0.2, 0.08, 0.0);
    for (what, in_time, entity_moves, camera_moves, expected) in [
        ("nothing moves", Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO),
        ("the splats move", by_time, Vec3::ZERO, Vec3::ZERO, by_time * seconds / 2.0),
        ("the entity moves", Vec3::ZERO, by_hand, Vec3::ZERO, by_hand),
        ("the camera moves", Vec3::ZERO, Vec3::ZERO, by_hand, -by_hand),
        ("both move together", Vec3::ZERO, by_hand, by_hand, Vec3::ZERO),
    ] {
        let Some(mut app) = unpipelined_app(SIZE) else { return };
        let vectors = Vectors::of(&mut app);
        let entity = spawn(&mut app, &moving(in_time), ());
        let camera = spawn_camera(&mut app, Msaa::Off, front());
        insert(&mut app, camera, (DepthPrepass, MotionVectorPrepass));
        testing::settle(&mut app).expect("the app runs");
        for frame in 1..4 {
            let frame = frame as f32;
            insert(&mut app, entity, Playback::paused_at(seconds * frame));
            insert(&mut app, entity, Transform::from_translation(entity_moves * frame));
            insert(&mut app, camera, Transform::from_translation(front().translation + camera_moves * frame));
            step(&mut app);
        }
        let (found, depth) = vectors.at(middle.x, middle.y);
        let pixels = found * SIZE.as_vec2();
        // y is down on the screen.
        let expected = Vec2::new(expected.x, -expected.y) * pixels_of_unit(4.0);
        let apart = (pixels - expected).abs().max_element();
        let bound = (0.02 * expected.length()).max(0.1);
        assert!(apart <= bound, "{what}: the motion is {pixels} pixels, not {expected}");
        // Bevy's near plane is at 0.1.
        assert!((depth - 0.1 / 4.0).abs() < 1e-3, "{what}: the depth of the prepass is {depth}");
    }
}

#[test]
fn a_jump_in_time_writes_no_motion() {
    let Some(mut app) = unpipelined_app(SIZE) else { return };
    let vectors = Vectors::of(&mut app);
    let entity = spawn(&mut app, &moving(Vec3::X), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    insert(&mut app, camera, (DepthPrepass, MotionVectorPrepass));
    testing::settle(&mut app).expect("the app runs");
    // After one of two seconds the splat has moved by half a unit.
    insert(&mut app, entity, Playback::paused_at(1.0));
    step(&mut app);
    let aside = SIZE.x / 2 + (0.5 * pixels_of_unit(4.0)) as u32;
    let (found, depth) = vectors.at(aside, SIZE.y / 2);
    assert!(depth > 0.0, "the splat is at its new position");
    assert!((found * SIZE.as_vec2()).abs().max_element() < 0.05, "the motion of the splat is 0: {found}");
    step(&mut app);
    let (found, depth) = vectors.at(1, 1);
    assert_eq!((found, depth), (Vec2::ZERO, 0.0), "pixels without splats are not written");
}

/// Clears the motion vectors before post-processing, as if captures wrote none.
fn forget_motion(app: &mut App) {
    fn forget(camera: ViewQuery<&ViewPrepassTextures>, mut context: RenderContext) {
        let Some(vectors) = &camera.into_inner().motion_vectors else { return };
        let cleared = wgpu::RenderPassColorAttachment {
            view: &vectors.texture.default_view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
        };
        let color_attachments = &[Some(cleared)];
        let pass = wgpu::RenderPassDescriptor { color_attachments, ..wgpu::RenderPassDescriptor::default() };
        drop(context.command_encoder().begin_render_pass(&pass));
    }
    let render_app = app.get_sub_app_mut(RenderApp).expect("a renderer");
    render_app.add_systems(Core3d, forget.after(Core3dSystems::MainPass).before(Core3dSystems::EarlyPostProcess));
}

/// Returns the picture of one frame of an app in which a capture moves to the right by this many pixels per frame.
fn picture_in_motion(app: &mut App, entity: Entity, pixels: f32) -> Vec<u8> {
    testing::settle(app).expect("the app runs");
    let place = |app: &mut App, frame: u32| {
        let x = frame as f32 * pixels / pixels_of_unit(4.0);
        insert(app, entity, Transform::from_xyz(x, 0.0, 0.0));
        step(app);
    };
    for frame in 1..FRAMES {
        place(app, frame);
    }
    let taken = Arc::new(Mutex::new(None));
    let sink = taken.clone();
    let store = move |event: On<ReadbackComplete>| {
        // The first read-back is the frame of the request.
        sink.lock().expect("the lock is not poisoned").get_or_insert_with(|| event.data.clone());
    };
    let image = app.world().resource::<Offscreen>().image.clone();
    app.world_mut().spawn(Readback::texture(image)).observe(store);
    for frame in FRAMES..FRAMES + 200 {
        place(app, frame);
        if let Some(picture) = taken.lock().expect("the lock is not poisoned").take() {
            return picture;
        }
    }
    panic!("the picture is not read back");
}

/// Returns the mean difference of two pictures in 255ths, away from their edges.
fn apart(a: &[u8], b: &[u8]) -> f32 {
    let inside = |index: usize| {
        let (x, y) = (index / 4 % SIZE.x as usize, index / 4 / SIZE.x as usize);
        index % 4 < 3 && (16..SIZE.x as usize - 8).contains(&x) && (8..SIZE.y as usize - 8).contains(&y)
    };
    let differences: Vec<f32> = a
        .iter()
        .zip(b)
        .enumerate()
        .filter(|(index, _)| inside(*index))
        .map(|(_, (a, b))| f32::from(a.abs_diff(*b)))
        .collect();
    differences.iter().sum::<f32>() / differences.len() as f32
}

/// Returns the picture of stripes moving to the right, with an effect on the camera.
fn stripes_in_motion(along_y: bool, pixels: f32, forgets: bool, effect: impl Bundle) -> Option<Vec<u8>> {
    let mut app = unpipelined_app(SIZE)?;
    if forgets {
        forget_motion(&mut app);
    }
    let entity = spawn(&mut app, &stripes(along_y), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    insert(&mut app, camera, effect);
    Some(picture_in_motion(&mut app, entity, pixels))
}

#[test]
fn temporal_anti_aliasing_does_not_smear_moving_captures() {
    // Less than half a stripe, so that the history at a wrong position has another color.
    let [Some(sharp), Some(with), Some(without)] = [
        stripes_in_motion(true, 2.0, false, ()),
        stripes_in_motion(true, 2.0, false, TemporalAntiAliasing::default()),
        stripes_in_motion(true, 2.0, true, TemporalAntiAliasing::default()),
    ] else {
        return;
    };
    let [with, without] = [with, without].map(|picture| apart(&picture, &sharp));
    assert!(without > 3.0, "without motion vectors stripes smear by {without} / 255");
    assert!(2.0 * with <= without, "motion vectors halve the smear: {with} / 255 with them, {without} / 255 without");
}

#[test]
fn motion_blur_follows_the_motion() {
    let blur = || MotionBlur { shutter_angle: 1.0, samples: 8 };
    let [Some(sharp_across), Some(across), Some(sharp_along), Some(along)] = [
        stripes_in_motion(true, 4.0, false, ()),
        stripes_in_motion(true, 4.0, false, blur()),
        stripes_in_motion(false, 4.0, false, ()),
        stripes_in_motion(false, 4.0, false, blur()),
    ] else {
        return;
    };
    let [across, along] = [apart(&across, &sharp_across), apart(&along, &sharp_along)];
    assert!(across > 5.0, "stripes across the motion are blurred by {across} / 255");
    assert!(
        along < across / 3.0,
        "stripes along the motion are blurred less: by {along} / 255, across by {across} / 255"
    );
}

#[test]
fn depth_of_field_blurs_captures_out_of_focus() {
    // The capture has the same size in the picture at both distances.
    let far = Transform::from_xyz(0.0, 0.0, -40.0).with_scale(Vec3::splat(11.0));
    let focus = DepthOfField {
        mode: DepthOfFieldMode::Gaussian,
        focal_distance: 4.0,
        aperture_f_stops: 1.0 / 50.0,
        ..default()
    };
    let mut blurred = Vec::new();
    for place in [Transform::default(), far] {
        let Some(mut app) = unpipelined_app(SIZE) else { return };
        spawn(&mut app, &stripes(true), place);
        let camera = spawn_camera(&mut app, Msaa::Off, front());
        let sharp = picture(&mut app, 0.0);
        insert(&mut app, camera, focus);
        let changed = |picture: image::RgbaImage| apart(&picture, &sharp);
        let by_default = changed(picture(&mut app, 0.0));
        insert(&mut app, camera, CaptureViewSettings { depth: DepthWrite::Expected, ..default() });
        let asked_for = changed(picture(&mut app, 0.0));
        assert!((by_default - asked_for).abs() <= 0.01, "the default depth setting equals DepthWrite::Expected");
        blurred.push(by_default);
    }
    let [near, far] = blurred[..] else { panic!("two distances are tested") };
    assert!(near <= 2.0, "a capture in focus is unchanged: {near} / 255");
    assert!(far > 10.0, "a capture far behind the focus is blurred: {far} / 255");
}

#[test]
fn volumetric_fog_darkens_a_farther_capture_more() {
    let far = Transform::from_xyz(0.0, 0.0, -40.0).with_scale(Vec3::splat(11.0));
    let mut light = Vec::new();
    for place in [Transform::default(), far] {
        let Some(mut app) = unpipelined_app(SIZE) else { return };
        spawn(&mut app, &white(), place);
        let camera = spawn_camera(&mut app, Msaa::Off, front());
        let clear = picture(&mut app, 0.0).get_pixel(SIZE.x / 2, SIZE.y / 2).0[0];
        assert!(clear > 200, "without fog the capture is white: {clear}");
        // Dark fog only absorbs light; Bevy draws no fog without a light.
        insert(&mut app, camera, VolumetricFog { ambient_intensity: 0.0, ..default() });
        app.world_mut().spawn((FogVolume::default(), Transform::from_scale(Vec3::splat(200.0))));
        let dark = DirectionalLight { illuminance: 0.0, shadow_maps_enabled: true, ..default() };
        app.world_mut().spawn((dark, VolumetricLight));
        light.push(picture(&mut app, 0.0).get_pixel(SIZE.x / 2, SIZE.y / 2).0[0]);
    }
    let [near, far] = light[..] else { panic!("two distances are tested") };
    assert!(near > 100, "fog darkens the near capture little: {near}");
    assert!(u32::from(far) * 2 < u32::from(near), "fog darkens the far capture more: {far}, the near one {near}");
}

#[test]
fn depth_is_written_only_for_cameras_with_effects_that_read_it() {
    let writes = |asked: DepthWrite, effect: bool| {
        let mut app = unpipelined_app(SIZE)?;
        app.add_plugins(RenderDiagnosticsPlugin);
        spawn(&mut app, &white(), ());
        let camera = spawn_camera(&mut app, Msaa::Off, front());
        insert(&mut app, camera, CaptureViewSettings { depth: asked, ..default() });
        if effect {
            insert(&mut app, camera, (DepthPrepass, MotionVectorPrepass));
        }
        picture(&mut app, 0.0);
        // Times arrive some frames later.
        (0..30).for_each(|_| step(&mut app));
        Some(has_recorded(&app, "gs4d/write_depth"))
    };
    for (asked, effect, expected) in [
        (DepthWrite::Auto, false, false),
        (DepthWrite::Expected, false, true),
        (DepthWrite::Auto, true, true),
        (DepthWrite::None, true, false),
    ] {
        let Some(found) = writes(asked, effect) else { return };
        assert_eq!(found, expected, "whether depth is written with {asked:?}, with an effect: {effect}");
    }
}
