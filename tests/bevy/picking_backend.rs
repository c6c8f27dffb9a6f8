//! Pointer events on captures in Bevy apps without a window: a pointer moves over and clicks on captures and meshes.
//!
//! In: a small capture, boxes in front of it and behind it, pointer input. Out: proof that events go to the nearest
//! object, with the depth convention of meshes, and that `Pickable`, layers, visibility and markers have their usual
//! meaning. Skipped without a GPU; a software driver is enough.

use crate::support::cpu_reference::SIZE;
use crate::support::fixtures::{front, insert, lone, spawn, spawn_flat_box};
use crate::support::offscreen_app::{self, spawn_camera};
use bevy::camera::visibility::RenderLayers;
use bevy::picking::backend::HitData;
use bevy::picking::pointer::{Location, PointerAction, PointerId, PointerInput};
use bevy::prelude::*;
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{FilterKind, RuntimeScene, TemporalFilter};
use bevy_gs4d::testing::{self, Offscreen};

/// The events received by the observers of [`watch`].
#[derive(Resource, Default)]
struct Said(Vec<(&'static str, Entity)>);

/// The hit of the last `Over` event.
#[derive(Resource, Default)]
struct LastHit(Option<HitData>);

/// Returns an app with a camera at (0, 0, 4) and a capture at the origin; `None` if there is no GPU.
fn app() -> Option<(App, Entity, Entity)> {
    let mut app = offscreen_app::app(SIZE)?;
    app.add_plugins(MeshPickingPlugin).init_resource::<Said>().init_resource::<LastHit>();
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let capture = spawn(&mut app, &lone(Vec3::X), Transform::default());
    watch(&mut app, capture);
    testing::settle(&mut app).expect("the app runs");
    Some((app, camera, capture))
}

/// Records the pointer events of an entity.
fn watch(app: &mut App, entity: Entity) {
    app.world_mut()
        .entity_mut(entity)
        .observe(move |over: On<Pointer<Over>>, mut said: ResMut<Said>, mut last: ResMut<LastHit>| {
            said.0.push(("over", entity));
            last.0 = Some(over.hit.clone());
        })
        .observe(move |_: On<Pointer<Out>>, mut said: ResMut<Said>| said.0.push(("out", entity)))
        .observe(move |_: On<Pointer<Click>>, mut said: ResMut<Said>| said.0.push(("click", entity)));
}

/// Spawns a box with sides of 0.3 at this z; the camera is on the +z side.
fn cube(app: &mut App, z: f32) -> Entity {
    let cube = spawn_flat_box(app, Vec3::splat(0.3), Vec3::Z * z, Color::WHITE);
    watch(app, cube);
    cube
}

/// Sends a pointer action at a position in pixels, and runs a frame.
fn act(app: &mut App, position: Vec2, action: PointerAction) {
    let target = app.world().resource::<Offscreen>().target().normalize(None).expect("a picture");
    app.world_mut().write_message(PointerInput::new(PointerId::Mouse, Location { target, position }, action));
    app.update();
}

fn move_to(app: &mut App, position: Vec2) {
    act(app, position, PointerAction::Move { delta: Vec2::ONE });
}

/// Returns the entities clicked in the middle of the picture, after two updates that apply earlier changes.
fn clicked(app: &mut App) -> Vec<Entity> {
    app.update();
    app.update();
    let middle = SIZE.as_vec2() / 2.0;
    move_to(app, middle);
    act(app, middle, PointerAction::Press(PointerButton::Primary));
    act(app, middle, PointerAction::Release(PointerButton::Primary));
    let said = std::mem::take(&mut app.world_mut().resource_mut::<Said>().0);
    said.into_iter().filter(|(what, _)| *what == "click").map(|(_, entity)| entity).collect()
}

#[test]
fn a_capture_receives_over_click_and_out_events() {
    let Some((mut app, camera, capture)) = app() else { return };
    let middle = SIZE.as_vec2() / 2.0;
    move_to(&mut app, middle);
    act(&mut app, middle, PointerAction::Press(PointerButton::Primary));
    act(&mut app, middle, PointerAction::Release(PointerButton::Primary));
    move_to(&mut app, Vec2::splat(2.0));
    let said = std::mem::take(&mut app.world_mut().resource_mut::<Said>().0);
    assert_eq!(
        said,
        [("over", capture), ("click", capture), ("out", capture)],
        "the events of a pointer that enters, clicks and leaves"
    );
    let hit = app.world_mut().resource_mut::<LastHit>().0.take().expect("an Over event with a hit");
    assert_eq!((hit.camera, hit.normal), (camera, None), "the hit has the camera and no normal");
    // The ray begins at the near plane, a tenth of a unit from the camera.
    assert!((hit.depth - 3.9).abs() < 0.01, "the depth is 3.9, not {}", hit.depth);
    assert!(hit.position.is_some_and(|at| at.length() < 0.02), "the position is the origin, not {:?}", hit.position);
    let found = hit.extra_as::<CaptureHit>().map(|found| (found.entity, found.gaussian));
    assert_eq!(found, Some((capture, 0)), "the extra data names the capture and the Gaussian");
}

#[test]
fn the_nearest_object_takes_the_click() {
    let Some((mut app, _, capture)) = app() else { return };
    let behind = cube(&mut app, -1.0);
    assert_eq!(clicked(&mut app), [capture], "the capture takes the click from a mesh behind it");
    let before = cube(&mut app, 1.0);
    assert_eq!(clicked(&mut app), [before], "a mesh in front takes the click");
    app.world_mut().despawn(before);
    let nearer = spawn(&mut app, &lone(Vec3::Y), Transform::from_xyz(0.0, 0.0, 1.0));
    watch(&mut app, nearer);
    testing::settle(&mut app).expect("the app runs");
    assert_eq!(clicked(&mut app), [nearer], "another capture in front takes the click");
    insert(&mut app, nearer, Pickable::IGNORE);
    insert(&mut app, capture, Pickable { should_block_lower: false, is_hoverable: true });
    let mut both = clicked(&mut app);
    both.sort();
    let mut expected = [capture, behind];
    expected.sort();
    assert_eq!(both, expected, "an ignored capture is skipped, and a capture that does not block passes the click on");
    insert(&mut app, nearer, Pickable { should_block_lower: true, is_hoverable: false });
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "a capture that is not hoverable still blocks");
}

#[test]
fn only_captures_that_the_camera_draws_are_hit() {
    let Some((mut app, camera, capture)) = app() else { return };
    insert(&mut app, capture, RenderLayers::layer(1));
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "a capture on another layer is not hit");
    insert(&mut app, camera, RenderLayers::from_layers(&[0, 1]));
    assert_eq!(clicked(&mut app), [capture], "a capture on a layer of the camera is hit");
    insert(&mut app, capture, Visibility::Hidden);
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "a hidden capture is not hit");
    insert(&mut app, capture, Visibility::Inherited);
    // Captures are drawn from 0.2 units on, rays begin at 0.1.
    for (distance, expected) in [(0.25, vec![capture]), (0.15, Vec::new())] {
        insert(&mut app, camera, Transform::from_xyz(0.0, 0.0, distance));
        assert_eq!(clicked(&mut app), expected, "the Gaussian is {distance} from the camera");
    }
}

#[test]
fn a_capture_rejected_by_the_gpu_does_not_block() {
    let Some((mut app, _, capture)) = app() else { return };
    // The filter belongs to a larger scene.
    let filter = TemporalFilter::from_bits(FilterKind::Support, 1, 2, vec![0b11]);
    let refused = RuntimeScene { filter: Some(filter), ..lone(Vec3::Y) };
    let before = spawn(&mut app, &refused, Transform::from_xyz(0.0, 0.0, 1.0));
    watch(&mut app, before);
    testing::settle(&mut app).expect("the app runs");
    let state = app.world().get::<CaptureState>(before).expect("a required component");
    assert!(matches!(state, CaptureState::Failed(_)), "the invalid capture has failed: {state:?}");
    assert_eq!(clicked(&mut app), [capture], "the failed capture in front does not block");
}

#[test]
fn with_require_markers_only_marked_captures_and_cameras_take_part() {
    let Some((mut app, camera, capture)) = app() else { return };
    app.insert_resource(CapturePickingSettings { require_markers: true });
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "no hit without markers");
    insert(&mut app, capture, Pickable::default());
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "no hit without a marked camera");
    insert(&mut app, camera, CapturePickingCamera);
    assert_eq!(clicked(&mut app), [capture], "a hit with both markers");
}
