//! Colliders in Bevy apps: entities with the mesh of what is solid in a capture.
//!
//! In: captures of two seconds with a standing mesh, and four stretches of half a second of what moves. Out: proof that
//! children of a capture have the mesh of its time, with one message and one change for each new mesh and none between,
//! that captures share their meshes, and that the log tells where there are none. Needs neither a GPU nor a window.

use crate::support::event_log::{debug, record, take_events};
use crate::support::logged::warnings_of;
use crate::support::playback_app::{self, change, get, pass, scene};
use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::mesh::{MeshVertexAttribute, VertexAttributeValues};
use bevy::prelude::*;
use bevy_gs4d::playback::{Clip, ColliderState, Timeline, TimelinePlayer, TimelineTrack, Track, collider_mesh};
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{ColliderMesh, ColliderStretch, Colliders, GaussianScene};
use std::sync::Arc;

/// Number of stretches of a capture, each half a second long.
const STRETCHES: usize = 4;
/// The stretch in which nothing moves.
const EMPTY: usize = 2;

/// How often a [`ColliderState`] has changed since the last call of [`changes`].
#[derive(Resource, Default)]
struct Changes(usize);

fn app() -> App {
    let mut app = playback_app::app("assets");
    record::<CaptureColliderChanged>(&mut app, Last);
    app.init_resource::<Changes>();
    app.add_systems(Last, |changed: Query<(), Changed<ColliderState>>, mut changes: ResMut<Changes>| {
        changes.0 += changed.iter().count();
    });
    app
}

/// Returns a tetrahedron with its first corner at `x` on the x axis.
fn solid(x: f32) -> ColliderMesh {
    let points = vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
    ColliderMesh { points, triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }
}

/// Returns the mesh of a stretch of [`colliders`].
fn moving(stretch: usize, at: f32) -> ColliderMesh {
    if stretch == EMPTY { ColliderMesh::default() } else { solid(at + stretch as f32) }
}

/// Returns colliders for the interval 0 to 1: a standing mesh at x = 0, and what moves from `at` on.
fn colliders(at: f32) -> Colliders {
    let stretch = |index: usize| {
        let [from, to] = [index, index + 1].map(|bound| bound as f32 / STRETCHES as f32);
        ColliderStretch { from, to, mesh: moving(index, at) }
    };
    Colliders { standing: solid(0.0), stretches: (0..STRETCHES).map(stretch).collect() }
}

/// Returns a capture of two seconds, with the interval 0 to 1.
fn capture(colliders: Option<Colliders>) -> GaussianCapture {
    let scene = GaussianScene { colliders: colliders.map(Arc::new), ..scene(2.0, 4) };
    GaussianCapture::new(scene.into_runtime().expect("a synthetic scene can be drawn"))
}

fn add(app: &mut App, colliders: Option<Colliders>) -> Handle<GaussianCapture> {
    app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(capture(colliders))
}

/// Gives a handle another capture, as a reload does.
fn replace(app: &mut App, handle: &Handle<GaussianCapture>, capture: GaussianCapture) {
    let mut captures = app.world_mut().resource_mut::<Assets<GaussianCapture>>();
    captures.insert(handle, capture).expect("the handle is alive");
}

/// Spawns a capture, and a child of it with a collider. Returns both.
fn spawn(
    app: &mut App,
    handle: &Handle<GaussianCapture>,
    playback: Playback,
    collider: CaptureCollider,
) -> [Entity; 2] {
    let player = app.world_mut().spawn((GaussianCapture3d(handle.clone()), playback)).id();
    let child = app.world_mut().spawn((collider, ChildOf(player))).id();
    [player, child]
}

/// Returns the messages about colliders since the last call, as observers and readers have received them.
fn messages(app: &mut App) -> Vec<String> {
    take_events(app).into_iter().filter(|text| text.starts_with("CaptureColliderChanged")).collect()
}

/// Returns how often a state has changed since the last call.
fn changes(app: &mut App) -> usize {
    std::mem::take(&mut app.world_mut().resource_mut::<Changes>().0)
}

fn message([capture, entity]: [Entity; 2], stretch: Option<usize>) -> String {
    debug(&CaptureColliderChanged { entity, capture, stretch })
}

fn mesh(app: &App, entity: Entity) -> Option<ColliderMesh> {
    get::<ColliderState>(app, entity).mesh().cloned()
}

/// Advances time, and checks that the collider has the stretch of the time that is drawn, with a message and a change
/// if it is another one than before, and without them if it is the same. Returns whether it is another one.
fn advance(app: &mut App, pair: [Entity; 2], seconds: f64) -> bool {
    let [player, child] = pair;
    let before = get::<ColliderState>(app, child).stretch();
    pass(app, seconds);
    let time = get::<Playback>(app, player).time;
    let expected = ((time / 0.5) as usize).min(STRETCHES - 1);
    let state = get::<ColliderState>(app, child);
    assert_eq!(state.stretch(), Some(expected), "the stretch at {time} s");
    let solid = Some(moving(expected, 10.0)).filter(|mesh| !mesh.is_empty());
    assert_eq!(state.mesh(), solid.as_ref(), "the mesh at {time} s");
    let is_new = before != Some(expected);
    let told = if is_new { vec![message(pair, Some(expected))] } else { Vec::new() };
    assert_eq!(messages(app), told, "the messages at {time} s, after stretch {before:?}");
    assert_eq!(changes(app), usize::from(is_new), "the changes of the state at {time} s, after stretch {before:?}");
    is_new
}

/// Advances time by steps of an eighth of a second. Returns the number of new meshes.
fn play(app: &mut App, pair: [Entity; 2], steps: usize) -> usize {
    (0..steps).filter(|_| advance(app, pair, 0.125)).count()
}

#[test]
fn the_standing_mesh_appears_once() {
    let mut app = app();
    let handle = add(&mut app, Some(colliders(10.0)));
    let pair = spawn(&mut app, &handle, Playback::default(), CaptureCollider::Standing);
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, pair[1]), Some(solid(0.0)), "the standing mesh");
    assert_eq!(get::<ColliderState>(&app, pair[1]).stretch(), None, "it is of no stretch");
    assert_eq!(messages(&mut app), [message(pair, None)], "one message tells of it");
    changes(&mut app);
    for _ in 0..20 {
        pass(&mut app, 0.25);
    }
    assert_eq!((messages(&mut app).len(), changes(&mut app)), (0, 0), "nothing more over two loops");
    assert_eq!(mesh(&app, pair[1]), Some(solid(0.0)), "it stays");
}

#[test]
fn what_moves_changes_where_a_stretch_begins() {
    let mut app = app();
    let handle = add(&mut app, Some(colliders(10.0)));
    let pair = spawn(&mut app, &handle, Playback::default(), CaptureCollider::Moving);
    assert!(advance(&mut app, pair, 0.0), "the first mesh");
    assert_eq!(play(&mut app, pair, 8), 2, "new meshes in a second of play");
    assert_eq!(get::<Playback>(&app, pair[0]).time, 1.0, "a second has been played");

    change(&mut app, pair[0], |playback: &mut Playback| playback.seek(1.75));
    assert!(advance(&mut app, pair, 0.0), "the mesh after a seek");
    assert!(!advance(&mut app, pair, 0.0), "no time has passed");

    change(&mut app, pair[0], Playback::reverse);
    assert_eq!(play(&mut app, pair, 12), 3, "new meshes in a second and a half backwards");
    assert_eq!(get::<Playback>(&app, pair[0]).time, 0.25, "a second and a half has been played backwards");

    change(&mut app, pair[0], Playback::reverse);
    assert_eq!(play(&mut app, pair, 16), 4, "new meshes in one pass of a loop");

    change(&mut app, pair[0], Playback::pause);
    assert_eq!(play(&mut app, pair, 8), 0, "a paused capture keeps its mesh");

    app.world_mut().entity_mut(pair[1]).insert(CaptureCollider::Standing);
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, pair[1]), Some(solid(0.0)), "the other part of the same capture");
    assert_eq!(messages(&mut app), [message(pair, None)], "a message tells of it");
}

#[test]
fn the_mesh_goes_with_the_asset_and_with_the_capture() {
    let mut app = app();
    let handle = add(&mut app, Some(colliders(10.0)));
    let moving = spawn(&mut app, &handle, Playback::paused_at(0.75), CaptureCollider::Moving);
    let standing = [moving[0], app.world_mut().spawn((CaptureCollider::Standing, ChildOf(moving[0]))).id()];
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, moving[1]), Some(solid(11.0)), "the second stretch");
    messages(&mut app);
    changes(&mut app);

    let removed = app.world_mut().resource_mut::<Assets<GaussianCapture>>().remove(&handle);
    pass(&mut app, 0.0);
    for [_, entity] in [moving, standing] {
        let state = get::<ColliderState>(&app, entity);
        assert!(state.mesh().is_none() && state.colliders().is_none(), "{entity} has nothing without the asset");
        assert_eq!(state.stretch(), None, "{entity} is in no stretch");
    }
    assert_eq!(messages(&mut app), [message(moving, None), message(standing, None)], "messages take both away");
    assert_eq!(changes(&mut app), 2, "both states have changed");
    pass(&mut app, 0.0);
    assert_eq!((messages(&mut app).len(), changes(&mut app)), (0, 0), "once");

    replace(&mut app, &handle, removed.expect("the asset was there"));
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, moving[1]), Some(solid(11.0)), "the asset is back");
    assert_eq!(messages(&mut app), [message(moving, Some(1)), message(standing, None)], "messages bring both back");

    app.world_mut().entity_mut(moving[0]).remove::<GaussianCapture3d>();
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, moving[1]), None, "the entity is no capture any more");
    assert_eq!(messages(&mut app), [message(moving, None), message(standing, None)], "messages take both away");

    app.world_mut().entity_mut(moving[0]).insert(GaussianCapture3d(handle));
    pass(&mut app, 0.0);
    assert_eq!(messages(&mut app).len(), 2, "the capture is back");
    app.world_mut().entity_mut(moving[0]).despawn();
    pass(&mut app, 0.0);
    assert_eq!(messages(&mut app), [""; 0], "entities that are gone have no message");
}

#[test]
fn the_mesh_goes_with_its_component() {
    let mut app = app();
    let handle = add(&mut app, Some(colliders(10.0)));
    let pair = spawn(&mut app, &handle, Playback::paused_at(0.75), CaptureCollider::Moving);
    pass(&mut app, 0.0);
    messages(&mut app);
    app.world_mut().entity_mut(pair[1]).remove::<CaptureCollider>();
    pass(&mut app, 0.0);
    assert!(app.world().get::<ColliderState>(pair[1]).is_none(), "the state is removed");
    assert_eq!(messages(&mut app), [message(pair, None)], "a message takes the mesh away");
    app.world_mut().entity_mut(pair[1]).insert(CaptureCollider::Moving);
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, pair[1]), Some(solid(11.0)), "the mesh is back");
    assert_eq!(messages(&mut app), [message(pair, Some(1))], "a message brings it back");
}

#[test]
fn a_track_is_solid_only_where_it_shows_a_clip() {
    let mut app = app();
    let capture = add(&mut app, Some(colliders(10.0)));
    let clip = Clip { capture, start: 1.0, range: [0.0, 2.0], speed: 1.0, fade: [0.0; 2] };
    let track = Track { name: "stage".into(), clips: vec![clip] };
    let timeline = Timeline::new(vec![track], Vec::new(), None).expect("a valid timeline");
    let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    let player = app.world_mut().spawn((TimelinePlayer(timeline), Playback::paused_at(1.5))).id();
    let track = app.world_mut().spawn((TimelineTrack("stage".into()), ChildOf(player))).id();
    let pair = [track, app.world_mut().spawn((CaptureCollider::Standing, ChildOf(track))).id()];
    for (seconds, expected) in [(1.5, Some(solid(0.0))), (0.5, None), (2.0, Some(solid(0.0)))] {
        change(&mut app, player, |playback: &mut Playback| playback.seek(seconds));
        pass(&mut app, 0.0);
        assert_eq!(mesh(&app, pair[1]), expected, "the mesh at {seconds} s, of a clip that begins at 1 s");
        assert_eq!(messages(&mut app), [message(pair, None)], "a message tells of it at {seconds} s");
    }
}

#[test]
fn a_reload_changes_the_mesh_only_with_other_colliders() {
    let mut app = app();
    let handle = add(&mut app, Some(colliders(10.0)));
    let pair = spawn(&mut app, &handle, Playback::paused_at(0.25), CaptureCollider::Moving);
    pass(&mut app, 0.0);
    messages(&mut app);
    changes(&mut app);

    replace(&mut app, &handle, capture(Some(colliders(20.0))));
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, pair[1]), Some(solid(20.0)), "the mesh of the new file");
    assert_eq!(messages(&mut app), [message(pair, Some(0))], "a message tells of it");
    assert_eq!(changes(&mut app), 1, "the state has changed");

    let equal = capture(Some(colliders(20.0)));
    let shared = equal.scene().colliders.clone().expect("the capture has colliders");
    replace(&mut app, &handle, equal);
    pass(&mut app, 0.0);
    assert_eq!((messages(&mut app).len(), changes(&mut app)), (0, 0), "equal colliders are no change");
    let state = get::<ColliderState>(&app, pair[1]);
    assert!(state.colliders().is_some_and(|all| Arc::ptr_eq(all, &shared)), "it shares those of the new asset");

    // What is drawn now is the same, a later stretch is not.
    let mut other = colliders(20.0);
    other.stretches[3].mesh = solid(50.0);
    replace(&mut app, &handle, capture(Some(other)));
    pass(&mut app, 0.0);
    assert_eq!(messages(&mut app), [message(pair, Some(0))], "a game must prepare the meshes of other colliders");

    replace(&mut app, &handle, capture(None));
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, pair[1]), None, "the new file has no colliders");
    assert_eq!(messages(&mut app), [message(pair, None)], "a message takes the mesh away");
}

#[test]
fn captures_of_one_asset_share_its_colliders() {
    let mut app = app();
    let handle = add(&mut app, Some(colliders(10.0)));
    let early = spawn(&mut app, &handle, Playback::paused_at(0.25), CaptureCollider::Moving);
    let late = spawn(&mut app, &handle, Playback::paused_at(1.75), CaptureCollider::Moving);
    pass(&mut app, 0.0);
    let captures = app.world().resource::<Assets<GaussianCapture>>();
    let asset = captures.get(&handle).and_then(|capture| capture.scene().colliders.as_ref());
    let asset = asset.expect("the asset has colliders");
    for ([_, entity], stretch) in [(early, 0), (late, 3)] {
        let state = get::<ColliderState>(&app, entity);
        assert_eq!(state.stretch(), Some(stretch), "each has the stretch of its own time");
        assert!(state.colliders().is_some_and(|all| Arc::ptr_eq(all, asset)), "stretch {stretch} is not copied");
    }
}

#[test]
fn a_collider_without_a_capture_or_its_colliders_is_named_once() {
    let mut app = app();
    let bare = add(&mut app, None);
    let [player, lacking] = spawn(&mut app, &bare, Playback::default(), CaptureCollider::Standing);
    let stray = app.world_mut().spawn(CaptureCollider::Moving).id();
    let reserved = app.world().resource::<Assets<GaussianCapture>>().reserve_handle();
    let [_, waiting] = spawn(&mut app, &reserved, Playback::default(), CaptureCollider::Moving);
    // Nothing moves in this one: no fault.
    let still = add(&mut app, Some(Colliders { stretches: Vec::new(), ..colliders(10.0) }));
    let [_, still] = spawn(&mut app, &still, Playback::default(), CaptureCollider::Moving);
    // On this thread, of which the log is read.
    app.edit_schedule(Update, |schedule| {
        schedule.set_executor(SingleThreadedExecutor::new());
    });
    let said = warnings_of(|| (0..3).for_each(|_| pass(&mut app, 0.0)));
    for entity in [lacking, stray, waiting, still] {
        assert_eq!(mesh(&app, entity), None, "{entity} has no mesh");
    }
    let naming = |entity: Entity| {
        let start = format!("{entity} has a CaptureCollider");
        said.iter().filter(|text| text.starts_with(&start)).cloned().collect::<Vec<_>>()
    };
    for (entity, remedy) in [(stray, "as a child of the capture"), (lacking, "`gs4d collide`")] {
        let named = naming(entity);
        assert_eq!(named.len(), 1, "one warning names {entity}: {said:?}");
        assert!(named[0].contains(remedy), "it has the remedy: {named:?}");
    }
    for entity in [waiting, still] {
        assert_eq!(naming(entity), [""; 0], "{entity} is as it should be");
    }
    app.world_mut().entity_mut(stray).insert(ChildOf(player));
    replace(&mut app, &bare, capture(Some(colliders(10.0))));
    messages(&mut app);
    pass(&mut app, 0.0);
    assert_eq!(mesh(&app, stray), Some(solid(10.0)), "a child of a capture has its mesh");
    assert_eq!(mesh(&app, lacking), Some(solid(0.0)), "colliders that arrive later are there");
    assert_eq!(messages(&mut app).len(), 2, "messages tell of both");
}

#[test]
fn a_mesh_of_bevy_has_the_same_triangles_with_normals_outwards() {
    // Of one of a millimeter, too.
    for size in [1.0, 1e-3] {
        let mut source = solid(0.0);
        source.points.iter_mut().flatten().for_each(|value| *value *= size);
        let kept = source.triangles.clone();
        source.triangles.push([0, 1, 4]);
        let mesh = collider_mesh(&source);
        let indices: Vec<usize> = mesh.indices().expect("the mesh has indices").iter().collect();
        let expected: Vec<usize> = kept.iter().flatten().map(|&index| index as usize).collect();
        assert_eq!(indices, expected, "the triangles, without that of a point that does not exist");
        let values =
            |attribute: MeshVertexAttribute| mesh.attribute(attribute).and_then(VertexAttributeValues::as_float3);
        let points = values(Mesh::ATTRIBUTE_POSITION).expect("the mesh has points");
        assert_eq!(points, source.points, "the points");
        let normals = values(Mesh::ATTRIBUTE_NORMAL).expect("the mesh has normals");
        let middle = points.iter().map(|&point| Vec3::from(point)).sum::<Vec3>() / 4.0;
        for (&point, &normal) in points.iter().zip(normals) {
            let outwards = Vec3::from(normal).dot((Vec3::from(point) - middle).normalize());
            assert!(outwards > 0.5, "the normal at {point:?} points outwards: {normal:?}");
        }
    }
    let empty = collider_mesh(&ColliderMesh::default());
    assert_eq!(empty.count_vertices(), 0, "nothing is an empty mesh");
}
