//! Balls that fall on the solid parts of a capture: its colliders in the physics of Avian.
//!
//! ```text
//! cargo run --release --manifest-path examples/physics/Cargo.toml -- CAPTURE [--balls N] [--headless]
//! ```
//!
//! CAPTURE is a package with colliders, which `gs4d collide` makes. In the first ten seconds, N (200) balls fall from
//! above its bounds, each where something standing is below it. With `--headless` there is no window: twenty seconds
//! pass in fixed steps, then one line counts the balls that fell through what stands, those whose center is in what is
//! solid by more than their radius, and those that rolled over an edge, and another compares the times of frames with
//! and without another mesh. The exit code is 1 if there are any balls of the first two kinds.
//!
//! `collide` is the code that a game needs: all meshes are prepared once, and exchanged when the capture says so.

use avian3d::prelude::{
    AngularDamping, Collider, LinearDamping, PhysicsPlugins, RigidBody, SleepingDisabled, TrimeshFlags,
};
use bevy::asset::UnapprovedPathMode;
use bevy::ecs::system::RunSystemOnce;
use bevy::log::{Level, LogPlugin};
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_gs4d::playback::{ColliderState, PlaybackSystems};
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{ColliderMesh, Colliders};
use bevy_gs4d::testing;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

const USAGE: &str = "physics CAPTURE [--balls N] [--headless]";
/// Time that passes without a window.
const RUN: Duration = Duration::from_secs(20);
/// Time in which the balls are dropped; frames are timed in the rest.
const DROPPING: Duration = Duration::from_secs(10);
/// Most balls: each has a ray that looks for the ground.
const MOST_BALLS: usize = 100_000;
/// A frame.
const FRAME: Duration = Duration::from_nanos(16_666_667);

#[derive(Resource)]
struct Settings {
    file: PathBuf,
    balls: usize,
    headless: bool,
}

/// A shape of Avian for each mesh of the capture.
#[derive(Resource, Default)]
struct Prepared {
    of: Option<Arc<Colliders>>,
    standing: Option<Collider>,
    moving: Vec<Option<Collider>>,
}

/// Whether the present frame has exchanged a mesh.
#[derive(Resource, Default)]
struct Exchanged(bool);

/// Where balls are dropped, in the world.
#[derive(Resource)]
struct Arena {
    /// From the world into capture space. The capture has no scale.
    to_capture: Affine3A,
    low: Vec3,
    high: Vec3,
    /// The radius of each ball.
    radius: f32,
    /// Places above something standing; one at least.
    places: Vec<Vec3>,
}

#[derive(Resource, Default, Clone, Copy)]
struct Count {
    /// Time since the first ball.
    seconds: f32,
    dropped: usize,
    /// Balls below the bounds, under something standing.
    through: usize,
    /// Balls below the bounds, beside it.
    over_an_edge: usize,
}

#[derive(Component)]
struct Ball;

fn main() -> Result<ExitCode> {
    let settings = parse()?;
    let headless = settings.headless;
    let mut app = App::new();
    // The capture may be in any folder.
    let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    if headless {
        app.add_plugins((MinimalPlugins, LogPlugin { level: Level::WARN, ..default() }, files, TransformPlugin));
    } else {
        app.add_plugins(DefaultPlugins.set(files))
            .add_systems(Startup, light)
            .add_systems(Update, (aim.run_if(resource_added::<Arena>), dress.run_if(resource_exists::<Arena>)));
    }
    app.add_plugins((GaussianCapturePlugins, PhysicsPlugins::default()))
        .insert_resource(settings)
        .init_resource::<Prepared>()
        .init_resource::<Count>()
        .init_resource::<Exchanged>()
        .add_systems(Startup, place)
        .add_systems(
            Update,
            (collide, lay_out.run_if(not(resource_exists::<Arena>))).chain().after(PlaybackSystems::Colliders),
        )
        .add_systems(FixedUpdate, drop_balls.run_if(resource_exists::<Arena>))
        // Physics is over then.
        .add_systems(FixedLast, collect.run_if(resource_exists::<Arena>));
    if headless {
        return judge(&mut app);
    }
    app.run();
    Ok(ExitCode::SUCCESS)
}

/// Reads the command line.
fn parse() -> Result<Settings> {
    let (mut file, mut balls, mut headless) = (None, 200, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--headless" => headless = true,
            "--balls" => {
                let count = arguments.next().and_then(|count| count.parse::<usize>().ok());
                balls = count
                    .filter(|count| (1..=MOST_BALLS).contains(count))
                    .ok_or("--balls needs a number, 1 to 100000")?;
            }
            option if option.starts_with('-') => return Err(format!("{option}: no such option: {USAGE}").into()),
            _ if file.is_some() => return Err(format!("{argument}: more than one capture: {USAGE}").into()),
            path => file = Some(std::path::absolute(path)?),
        }
    }
    let file = file.ok_or_else(|| format!("name a capture with colliders: {USAGE}"))?;
    Ok(Settings { file, balls, headless })
}

fn place(mut commands: Commands, assets: Res<AssetServer>, settings: Res<Settings>) {
    commands.spawn((
        GaussianCapture3d(assets.load(settings.file.clone())),
        Upright,
        children![CaptureCollider::Standing, CaptureCollider::Moving],
    ));
}

/// Gives each collider of the capture the shape of its mesh, when it has another one.
fn collide(
    mut commands: Commands,
    mut changes: MessageReader<CaptureColliderChanged>,
    mut colliders: Query<(&CaptureCollider, &ColliderState, Option<&mut Collider>)>,
    mut prepared: ResMut<Prepared>,
    mut exchanged: ResMut<Exchanged>,
) {
    for change in changes.read() {
        exchanged.0 = true;
        let Ok((part, state, present)) = colliders.get_mut(change.entity) else { continue };
        if let Some(all) = state.colliders() {
            prepared.prepare(all);
        }
        let shape = state.mesh().and_then(|_| prepared.shape(*part, state.stretch()));
        let mut entity = commands.entity(change.entity);
        match (shape, present) {
            // A shape that is exchanged in place has its mass found once by Avian, and twice if it is inserted.
            (Some(shape), Some(mut present)) => present.clone_from(shape),
            // The body begins where the capture stands then: upright.
            (Some(shape), None) => {
                entity.insert_if_new(RigidBody::Static).insert(shape.clone());
            }
            (None, _) => {
                entity.remove::<Collider>();
            }
        }
    }
}

impl Prepared {
    /// Makes the shapes of all meshes, once for each capture that is loaded: exchanging them takes no time then.
    fn prepare(&mut self, all: &Arc<Colliders>) {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, all)) {
            return;
        }
        let moving = all.stretches.iter().map(|stretch| shape(&stretch.mesh)).collect();
        *self = Self { of: Some(all.clone()), standing: shape(&all.standing), moving };
    }

    /// Returns the shape of what stands, or of what moves in a stretch of time.
    fn shape(&self, part: CaptureCollider, stretch: Option<usize>) -> Option<&Collider> {
        match part {
            CaptureCollider::Standing => self.standing.as_ref(),
            CaptureCollider::Moving => self.moving.get(stretch?)?.as_ref(),
        }
    }
}

/// Returns the shape of a mesh; `None` if it is empty.
fn shape(mesh: &ColliderMesh) -> Option<Collider> {
    if mesh.is_empty() {
        return None;
    }
    let points = mesh.points.iter().copied().map(Vec3::from).collect();
    // The flag includes ORIENTED: the mesh has an inside. Balls do not bump into the edges of a plane.
    let made = Collider::try_trimesh_with_config(points, mesh.triangles.clone(), TrimeshFlags::FIX_INTERNAL_EDGES);
    made.inspect_err(|error| warn!("a mesh is left out: {error:?}")).ok()
}

/// Finds the places from which balls fall on something standing, once the capture is there.
fn lay_out(
    mut commands: Commands,
    prepared: Res<Prepared>,
    settings: Res<Settings>,
    capture: Single<&Transform, With<GaussianCapture3d>>,
) {
    let (Some(colliders), Some(ground)) = (&prepared.of, &prepared.standing) else { return };
    let corner = |ends: [Vec3; 2], index: usize| {
        Vec3::new(ends[index & 1].x, ends[(index >> 1) & 1].y, ends[(index >> 2) & 1].z)
    };
    let boxes = colliders.meshes().filter_map(ColliderMesh::bounds);
    let (low, high) = boxes
        .flat_map(|ends| (0..8).map(move |index| corner(ends, index)))
        .map(|point| capture.transform_point(point))
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)));
    let (size, to_capture) = (high - low, capture.compute_affine().inverse());
    let radius = size.max_element() / 50.0;
    let place = |index: usize| {
        // A sequence that fills the square evenly.
        let [u, v] = [0.754_877_7, 0.569_840_3].map(|step: f64| (0.5 + step * index as f64).fract() as f32);
        Vec3::new(low.x + size.x * u, high.y + 2.0 * radius, low.z + size.z * v)
    };
    let places: Vec<Vec3> = (0..8 * settings.balls)
        .map(place)
        .filter(|place| is_hit(ground, &to_capture, *place, Vec3::NEG_Y))
        .take(settings.balls)
        .collect();
    if !places.is_empty() {
        commands.insert_resource(Arena { to_capture, low, high, radius, places });
    }
}

/// Returns whether a ray in the world hits what stands.
fn is_hit(ground: &Collider, to_capture: &Affine3A, from: Vec3, direction: Vec3) -> bool {
    let (from, direction) = (to_capture.transform_point3(from), to_capture.transform_vector3(direction));
    ground.cast_ray(Vec3::ZERO, Quat::IDENTITY, from, direction, f32::MAX, true).is_some()
}

fn drop_balls(
    mut commands: Commands,
    time: Res<Time>,
    arena: Res<Arena>,
    settings: Res<Settings>,
    mut count: ResMut<Count>,
) {
    count.seconds += time.delta_secs();
    let due = (settings.balls as f32 * (count.seconds / DROPPING.as_secs_f32()).min(1.0)) as usize;
    while count.dropped < due {
        commands.spawn((
            Ball,
            Transform::from_translation(arena.places[count.dropped % arena.places.len()]),
            RigidBody::Dynamic,
            Collider::sphere(arena.radius),
            LinearDamping(0.2),
            AngularDamping(4.0),
            // A sleeping ball would stay in the air where what moves has left it.
            SleepingDisabled,
        ));
        count.dropped += 1;
    }
}

/// Takes away and counts the balls below the bounds.
fn collect(
    mut commands: Commands,
    arena: Res<Arena>,
    prepared: Res<Prepared>,
    mut count: ResMut<Count>,
    balls: Query<(Entity, &Transform), With<Ball>>,
) {
    for (entity, ball) in &balls {
        let center = ball.translation;
        if center.y + arena.radius >= arena.low.y {
            continue;
        }
        let ground = prepared.standing.as_ref();
        if ground.is_some_and(|ground| is_hit(ground, &arena.to_capture, center, Vec3::Y)) {
            count.through += 1;
        } else {
            count.over_an_edge += 1;
        }
        commands.entity(entity).despawn();
    }
}

/// Runs the app without a window, and prints what became of the balls.
fn judge(app: &mut App) -> Result<ExitCode> {
    testing::step(app, DROPPING)?;
    let [usual, exchanging, after] = times_of_frames(app)?.map(median);
    if !app.world().contains_resource::<Arena>() {
        return Err("the capture has no standing mesh on which balls could fall: `gs4d collide` makes colliders".into());
    }
    let inside = app.world_mut().run_system_once(inside).map_err(|error| error.to_string())?;
    let Count { dropped, through, over_an_edge, .. } = *app.world().resource::<Count>();
    println!(
        "{dropped} balls in {} s: {through} fell through what stands, {inside} are inside of something solid, \
         {over_an_edge} rolled over an edge",
        RUN.as_secs()
    );
    println!(
        "frames with physics, medians: {usual:.3} ms, {exchanging:.3} ms if a mesh is exchanged, {after:.3} ms after that"
    );
    Ok(ExitCode::from(u8::from(through + inside > 0)))
}

/// Runs the rest of the time, and returns the milliseconds of the frames without another mesh, of those with one, and
/// of those that follow these. Each has the update of no time that a step begins with, too.
fn times_of_frames(app: &mut App) -> Result<[Vec<f64>; 3]> {
    let mut times = [const { Vec::new() }; 3];
    let mut follows = false;
    for _ in 0..(RUN - DROPPING).as_nanos() / FRAME.as_nanos() {
        app.world_mut().resource_mut::<Exchanged>().0 = false;
        let begun = Instant::now();
        testing::step(app, FRAME)?;
        let milliseconds = 1e3 * begun.elapsed().as_secs_f64();
        let exchanges = app.world().resource::<Exchanged>().0;
        times[if exchanges {
            1
        } else if follows {
            2
        } else {
            0
        }]
        .push(milliseconds);
        follows = exchanges;
    }
    Ok(times)
}

/// Returns the median; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Returns the number of balls whose center is in something solid by more than their radius.
fn inside(
    arena: Res<Arena>,
    prepared: Res<Prepared>,
    colliders: Query<(&CaptureCollider, &ColliderState)>,
    balls: Query<&Transform, With<Ball>>,
) -> usize {
    let shapes = colliders.iter().filter_map(|(part, state)| prepared.shape(*part, state.stretch()));
    let shapes: Vec<&Collider> = shapes.collect();
    let is_inside = |ball: &&Transform| {
        let center = arena.to_capture.transform_point3(ball.translation);
        shapes.iter().any(|shape| {
            let (surface, is_inside) = shape.project_point(Vec3::ZERO, Quat::IDENTITY, center, false);
            is_inside && surface.distance(center) > arena.radius
        })
    };
    balls.iter().filter(is_inside).count()
}

fn light(mut commands: Commands) {
    commands.spawn((Camera3d::default(), Msaa::Off));
    commands.spawn((DirectionalLight::default(), Transform::from_xyz(1.0, 3.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y)));
}

/// Points the camera at the capture.
fn aim(arena: Res<Arena>, mut camera: Single<&mut Transform, With<Camera3d>>) {
    let (center, size) = (0.5 * (arena.low + arena.high), (arena.high - arena.low).length());
    let eye = center + size * Vec3::new(0.6, 0.5, 0.9);
    **camera = Transform::from_translation(eye).looking_at(center, Vec3::Y);
}

/// Makes new balls visible.
fn dress(
    mut commands: Commands,
    arena: Res<Arena>,
    balls: Query<Entity, Added<Ball>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut looks: Local<Option<(Handle<Mesh>, Handle<StandardMaterial>)>>,
) {
    for ball in &balls {
        let (mesh, material) = looks
            .get_or_insert_with(|| (meshes.add(Sphere::new(arena.radius)), materials.add(Color::srgb(0.9, 0.4, 0.1))));
        commands.entity(ball).insert((Mesh3d(mesh.clone()), MeshMaterial3d(material.clone())));
    }
}
