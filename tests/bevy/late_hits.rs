//! Pointer events on large captures, which are searched in the background.
//!
//! In: a capture with more Gaussians than are searched in a frame, pointer input. Out: proof that the events arrive
//! some frames later, and that they stay while the pointer rests. Skipped without a GPU; a software driver is enough.

use crate::support::cpu_reference::SIZE;
use crate::support::fixtures::{front, lone, spawn};
use crate::support::offscreen_app::{self, spawn_camera};
use crate::support::waiting::wait_until;
use bevy::picking::pointer::{Location, PointerAction, PointerId, PointerInput};
use bevy::prelude::*;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::testing::{self, Offscreen};

/// The number of `Over` and of `Out` events.
#[derive(Resource, Default, Clone, Copy, PartialEq, Debug)]
struct Counted {
    over: usize,
    out: usize,
}

fn counted(app: &App) -> Counted {
    *app.world().resource::<Counted>()
}

/// Returns the scene of one Gaussian in the middle, with many Gaussians behind it that no ray of the middle meets.
fn large() -> RuntimeScene {
    let mut scene = lone(Vec3::X);
    let count = 40_000;
    let sliced = scene.form.as_sliced_mut().expect("a sliced scene");
    let mut other = sliced.gaussians[0];
    other.mean = [0.0, -1.5, -1.0];
    other.covariance = other.covariance.map(|entry| entry * 1e-3);
    let color = sliced.harmonics.values.clone();
    for _ in 1..count {
        sliced.gaussians.push(other);
        sliced.harmonics.values.extend_from_slice(&color);
    }
    scene
}

#[test]
fn events_on_a_large_capture_arrive_late_and_stay_while_the_pointer_rests() {
    let Some(mut app) = offscreen_app::app(SIZE) else { return };
    app.init_resource::<Counted>();
    spawn_camera(&mut app, Msaa::Off, front());
    let capture = spawn(&mut app, &large(), Transform::default());
    app.world_mut()
        .entity_mut(capture)
        .observe(|_: On<Pointer<Over>>, mut counted: ResMut<Counted>| counted.over += 1)
        .observe(|_: On<Pointer<Out>>, mut counted: ResMut<Counted>| counted.out += 1);
    testing::settle(&mut app).expect("the app runs");
    let move_to = |app: &mut App, position: Vec2| {
        let target = app.world().resource::<Offscreen>().target().normalize(None).expect("a picture");
        let action = PointerAction::Move { delta: Vec2::ONE };
        app.world_mut().write_message(PointerInput::new(PointerId::Mouse, Location { target, position }, action));
        app.update();
    };
    move_to(&mut app, SIZE.as_vec2() / 2.0);
    wait_until(&mut app, "the Over event", |app| counted(app).over > 0, App::update);
    for _ in 0..20 {
        app.update();
    }
    assert_eq!(counted(&app), Counted { over: 1, out: 0 }, "the capture stays hovered while the pointer rests");
    move_to(&mut app, Vec2::splat(2.0));
    wait_until(&mut app, "the Out event", |app| counted(app).out > 0, App::update);
    assert_eq!(counted(&app), Counted { over: 1, out: 1 }, "one event for each change");
}
