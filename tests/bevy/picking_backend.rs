//! Pointer events on captures in Bevy apps without a window: a pointer that moves over a picture and clicks, captures, and meshes among them.
//!
//! In: a small capture, boxes in front of it and behind, the input of a pointer. Out: proof that events go to what is in front, with the depth
//! that meshes have, and that `Pickable`, layers, visibility and markers have their usual meaning. Skipped where there is no GPU, not even a
//! software one.

use crate::support::cpu_reference::SIZE;
use crate::support::fixtures::{front, insert, lone, spawn, spawn_box};
use crate::support::offscreen_app::{self, spawn_camera};
use bevy::camera::visibility::RenderLayers;
use bevy::picking::backend::HitData;
use bevy::picking::pointer::{Location, PointerAction, PointerId, PointerInput};
use bevy::prelude::*;
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{FilterKind, RuntimeScene, TemporalFilter};
use bevy_gs4d::testing::{self, Offscreen};

/// What the observers of [`watch`] have received.
#[derive(Resource, Default)]
struct Said(Vec<(&'static str, Entity)>);

/// The last hit that a pointer came over.
#[derive(Resource, Default)]
struct LastHit(Option<HitData>);

/// Returns an app with one camera at (0, 0, 4), and a capture at the origin; `None` if there is no GPU.
fn app() -> Option<(App, Entity, Entity)> {
    let mut app = offscreen_app::app(SIZE)?;
    app.add_plugins(MeshPickingPlugin).init_resource::<Said>().init_resource::<LastHit>();
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let capture = spawn(&mut app, &lone(Vec3::X), Transform::default());
    watch(&mut app, capture);
    testing::settle(&mut app).expect("the app runs");
    Some((app, camera, capture))
}

/// Records what happens to an entity.
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

/// Spawns a box of a third of a unit at a distance from the origin towards the camera.
fn cube(app: &mut App, z: f32) -> Entity {
    let cube = spawn_box(app, Vec3::splat(0.3), Vec3::Z * z, Color::WHITE, AlphaMode::Opaque);
    watch(app, cube);
    cube
}

/// Lets the pointer do something at a place, in pixels, and runs a frame.
fn act(app: &mut App, position: Vec2, action: PointerAction) {
    let target = app.world().resource::<Offscreen>().target().normalize(None).expect("a picture");
    app.world_mut().write_message(PointerInput::new(PointerId::Mouse, Location { target, position }, action));
    app.update();
}

fn move_to(app: &mut App, position: Vec2) {
    act(app, position, PointerAction::Move { delta: Vec2::ONE });
}

/// Returns who is clicked in the middle of the picture, once all that has changed has taken effect.
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
fn a_pointer_comes_over_a_capture_clicks_and_leaves() {
    let Some((mut app, camera, capture)) = app() else { return };
    let middle = SIZE.as_vec2() / 2.0;
    move_to(&mut app, middle);
    act(&mut app, middle, PointerAction::Press(PointerButton::Primary));
    act(&mut app, middle, PointerAction::Release(PointerButton::Primary));
    move_to(&mut app, Vec2::splat(2.0));
    let said = std::mem::take(&mut app.world_mut().resource_mut::<Said>().0);
    assert_eq!(said, [("over", capture), ("click", capture), ("out", capture)], "as on a mesh");
    let hit = app.world_mut().resource_mut::<LastHit>().0.take().expect("it came over the capture");
    assert_eq!((hit.camera, hit.normal), (camera, None), "through the camera; a capture has no normal");
    // The ray begins at the near plane, a tenth of a unit from the camera.
    assert!((hit.depth - 3.9).abs() < 0.01, "3.9 units away, not {}", hit.depth);
    assert!(hit.position.is_some_and(|at| at.length() < 0.02), "at the origin, not at {:?}", hit.position);
    let found = hit.extra_as::<CaptureHit>().map(|found| (found.entity, found.gaussian));
    assert_eq!(found, Some((capture, 0)), "with the Gaussian that was hit");
}

#[test]
fn what_is_in_front_takes_the_click() {
    let Some((mut app, _, capture)) = app() else { return };
    let behind = cube(&mut app, -1.0);
    assert_eq!(clicked(&mut app), [capture], "a mesh behind is hidden by the capture");
    let before = cube(&mut app, 1.0);
    assert_eq!(clicked(&mut app), [before], "a mesh in front hides it");
    app.world_mut().despawn(before);
    let nearer = spawn(&mut app, &lone(Vec3::Y), Transform::from_xyz(0.0, 0.0, 1.0));
    watch(&mut app, nearer);
    testing::settle(&mut app).expect("the app runs");
    assert_eq!(clicked(&mut app), [nearer], "as does another capture");
    insert(&mut app, nearer, Pickable::IGNORE);
    insert(&mut app, capture, Pickable { should_block_lower: false, is_hoverable: true });
    let mut both = clicked(&mut app);
    both.sort();
    let mut expected = [capture, behind];
    expected.sort();
    assert_eq!(both, expected, "one is passed by, the other lets through");
    insert(&mut app, nearer, Pickable { should_block_lower: true, is_hoverable: false });
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "what is not hoverable may still be in the way");
}

#[test]
fn only_what_the_camera_draws_is_hit() {
    let Some((mut app, camera, capture)) = app() else { return };
    insert(&mut app, capture, RenderLayers::layer(1));
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "on another layer");
    insert(&mut app, camera, RenderLayers::from_layers(&[0, 1]));
    assert_eq!(clicked(&mut app), [capture], "which the camera sees now");
    insert(&mut app, capture, Visibility::Hidden);
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "hidden");
}

#[test]
fn what_the_gpu_refuses_is_not_in_the_way() {
    let Some((mut app, _, capture)) = app() else { return };
    // The filter is that of a larger scene.
    let filter = TemporalFilter::from_bits(FilterKind::Support, 1, 2, vec![0b11]);
    let refused = RuntimeScene { filter: Some(filter), ..lone(Vec3::Y) };
    let before = spawn(&mut app, &refused, Transform::from_xyz(0.0, 0.0, 1.0));
    watch(&mut app, before);
    testing::settle(&mut app).expect("the app runs");
    let state = app.world().get::<CaptureState>(before).expect("a required component");
    assert!(matches!(state, CaptureState::Failed(_)), "it is refused: {state:?}");
    assert_eq!(clicked(&mut app), [capture], "nobody sees what is in front");
}

#[test]
fn markers_are_required_if_the_game_says_so() {
    let Some((mut app, camera, capture)) = app() else { return };
    app.insert_resource(CapturePickingSettings { require_markers: true });
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "neither is marked");
    insert(&mut app, capture, Pickable::default());
    assert_eq!(clicked(&mut app), [Entity::PLACEHOLDER; 0], "the camera is not");
    insert(&mut app, camera, CapturePickingCamera);
    assert_eq!(clicked(&mut app), [capture], "both are");
}
