//! The scene of the example `film`: a floating island with a cherry tree that sheds petals, a gate with paper lanterns,
//! carp streamers in the wind and a fire.
//!
//! In: a time in seconds. Out: the pose and shape of everything that moves, and ten named points on it. The scene is a
//! loop of [`SECONDS`], or of a [`Take`], and depends on the time alone.

use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::NoFrustumCulling;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_gs4d::testing::FilmedPoint;
use std::f32::consts::TAU;

/// Length of the loop.
pub const SECONDS: f32 = 4.0;
/// The point that the cameras look at.
pub const CENTER: Vec3 = Vec3::new(0.0, 0.22, 0.0);
/// Distance of the cameras.
pub const DISTANCE: f32 = 3.25;

const PETALS: usize = 140;
const FLAMES: usize = 28;
/// Rings of a streamer, from its mouth to its tail, and points of each ring.
const RINGS: usize = 28;
const POINTS: usize = 14;
/// Place of the fire, of the top of the pole, of the middle of the tree's crown.
const FIRE: Vec3 = Vec3::new(0.52, 0.03, 0.42);
const POLE: Vec3 = Vec3::new(0.62, 1.02, -0.42);
const CROWN: Vec3 = Vec3::new(-0.48, 0.78, -0.18);
/// Height below which a petal is among the grass.
const GRASS: f32 = 0.05;

/// A longer take, for captures of minutes: the loop is repeated, but petals fall along other ways each time, and the sun
/// moves, and is low and warm in the middle of the take.
#[derive(Resource, Clone, Copy)]
pub struct Take {
    /// Its length, a whole number of loops.
    pub seconds: f32,
}

/// A thing that moves.
#[derive(Component, Clone, Copy)]
enum Moving {
    Sun,
    Petal(usize),
    Flame(usize),
    /// A paper lantern, which hangs from this point.
    Lantern(Vec3),
    /// A ball of blossoms of the crown, around this point.
    Blossoms(Vec3),
    /// A streamer that hangs so much below the top of the pole, of this length.
    Streamer {
        below: f32,
        length: f32,
    },
    FireLight,
    /// A point on this petal.
    OnPetal(usize),
    /// A point on the streamer with these measures: one of its points.
    OnStreamer {
        below: f32,
        length: f32,
        point: usize,
    },
}

/// Spawns the scene.
pub fn spawn(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mut matte = |red: f32, green: f32, blue: f32| {
        let base_color = Color::srgb(red, green, blue);
        materials.add(StandardMaterial { base_color, perceptual_roughness: 1.0, reflectance: 0.1, ..default() })
    };
    let [white, red, dark, bark, stone] =
        [[1.0; 3], [0.78, 0.16, 0.1], [0.16, 0.14, 0.16], [0.36, 0.24, 0.18], [0.55, 0.54, 0.52]]
            .map(|[red, green, blue]| matte(red, green, blue));
    let petals = [[0.98, 0.72, 0.8], [0.95, 0.58, 0.7], [1.0, 0.86, 0.9]].map(|[r, g, b]| matte(r, g, b));
    let sun = DirectionalLight { shadow_maps_enabled: true, illuminance: 6200.0, color: SUN, ..default() };
    commands.spawn((Moving::Sun, sun, sun_pose(0.0)));

    commands.spawn((Mesh3d(meshes.add(island())), MeshMaterial3d(white.clone())));
    // The gate: two posts, two beams.
    let post = meshes.add(Cylinder::new(0.045, 0.82));
    for x in [-0.1, 0.5] {
        commands.spawn((Mesh3d(post.clone()), MeshMaterial3d(red.clone()), Transform::from_xyz(x, 0.4, -0.02)));
    }
    for (size, y, material) in [
        (Vec3::new(1.02, 0.07, 0.13), 0.84, &dark),
        (Vec3::new(0.92, 0.06, 0.1), 0.775, &red),
        (Vec3::new(0.78, 0.055, 0.07), 0.63, &red),
    ] {
        let beam = meshes.add(Cuboid::from_size(size));
        let pose = Transform::from_xyz(0.2, y, -0.02);
        let mut beam = commands.spawn((Mesh3d(beam), MeshMaterial3d(material.clone()), pose));
        if size.x > 1.0 {
            beam.with_child(named("gate", Vec3::new(0.4, size.y / 2.0, 0.0)));
        }
    }
    // The tree.
    let limbs = [
        (Vec3::new(-0.56, 0.0, -0.22), Vec3::new(-0.5, 0.34, -0.2), 0.075),
        (Vec3::new(-0.5, 0.32, -0.2), Vec3::new(-0.62, 0.66, -0.16), 0.05),
        (Vec3::new(-0.5, 0.32, -0.2), Vec3::new(-0.32, 0.7, -0.22), 0.045),
        (Vec3::new(-0.52, 0.4, -0.2), Vec3::new(-0.46, 0.68, 0.06), 0.035),
    ];
    for (from, to, radius) in limbs {
        let mesh = meshes.add(Cylinder::new(radius, from.distance(to)));
        let turn = Quat::from_rotation_arc(Vec3::Y, (to - from).normalize());
        let pose = Transform::from_translation((from + to) / 2.0).with_rotation(turn);
        commands.spawn((Mesh3d(mesh), MeshMaterial3d(bark.clone()), pose));
    }
    for index in 0..13 {
        let direction = Vec3::new(chance(index, 1) - 0.5, 0.62 * (chance(index, 2) - 0.45), chance(index, 3) - 0.5);
        let place = CROWN + 0.78 * direction;
        let ball = blossoms(0.15 + 0.09 * chance(index, 4), index);
        let top = highest(&ball);
        let material = MeshMaterial3d(petals[index % 3].clone());
        let pose = Transform::from_translation(place);
        let mut ball = commands.spawn((Moving::Blossoms(place), Mesh3d(meshes.add(ball)), material, pose));
        // No other ball is above this one.
        if index == 12 {
            ball.with_child(named("blossoms", top));
        }
    }
    let petal = meshes.add(Sphere::new(0.02).mesh().ico(1).unwrap_or_else(|_| Sphere::new(0.02).into()));
    for index in 0..PETALS {
        let material = MeshMaterial3d(petals[index % 3].clone());
        let mut petal = commands.spawn((Moving::Petal(index), Mesh3d(petal.clone()), material, Transform::default()));
        // Two large ones that are in the air in the middle of the loop.
        let name = match index {
            3 => "early petal",
            11 => "late petal",
            _ => continue,
        };
        petal.with_child((Moving::OnPetal(index), named(name, 0.02 * Vec3::Y)));
    }
    // Lanterns hang from the lower beam.
    let glow = materials.add(StandardMaterial { base_color: Color::srgb(1.0, 0.8, 0.45), unlit: true, ..default() });
    let lantern = meshes.add(Sphere::new(0.075));
    for (name, side, x) in [("left lantern", Vec3::Z, 0.06), ("right lantern", Vec3::X, 0.34)] {
        let hook = Vec3::new(x, 0.6, -0.02);
        commands
            .spawn((Moving::Lantern(hook), Mesh3d(lantern.clone()), MeshMaterial3d(glow.clone()), Transform::default()))
            .with_child((
                Mesh3d(meshes.add(Cylinder::new(0.035, 0.17))),
                MeshMaterial3d(dark.clone()),
                Transform::default(),
            ))
            .with_child(PointLight { intensity: 9000.0, range: 1.5, color: WARM, ..default() })
            .with_child(named(name, 0.075 * side));
    }
    // The fire, in a ring of stones.
    for index in 0..9 {
        let (sin, cos) = (TAU * index as f32 / 9.0).sin_cos();
        let radius = 0.05 + 0.012 * chance(index, 9);
        let (mesh, place) = (meshes.add(Sphere::new(radius)), FIRE + Vec3::new(0.15 * cos, 0.0, 0.15 * sin));
        let pose = Transform::from_translation(place);
        let mut entity = commands.spawn((Mesh3d(mesh), MeshMaterial3d(stone.clone()), pose));
        // The one in front of the fire.
        if index == 2 {
            entity.with_child(named("stone", radius * Vec3::Y));
        }
    }
    let flame = meshes.add(Sphere::new(1.0));
    for index in 0..FLAMES {
        let own = materials.add(StandardMaterial { unlit: true, ..default() });
        commands.spawn((Moving::Flame(index), Mesh3d(flame.clone()), MeshMaterial3d(own), Transform::default()));
    }
    let light = PointLight { shadow_maps_enabled: true, color: WARM, range: 3.0, ..default() };
    commands.spawn((Moving::FireLight, light, Transform::from_translation(FIRE + 0.2 * Vec3::Y)));
    // The streamers, on their pole.
    let pole = meshes.add(Cylinder::new(0.018, POLE.y + 0.04));
    let pose = Transform::from_xyz(POLE.x, POLE.y / 2.0 - 0.02, POLE.z);
    commands.spawn((Mesh3d(pole), MeshMaterial3d(bark), pose));
    let cloth = materials.add(StandardMaterial {
        perceptual_roughness: 1.0,
        reflectance: 0.1,
        double_sided: true,
        cull_mode: None,
        ..default()
    });
    let streamers = [
        ("long streamer", 24, 0.0, 0.62, [0.12, 0.2, 0.5], [0.92, 0.93, 0.95]),
        ("middle streamer", 14, 0.2, 0.52, [0.82, 0.16, 0.14], [1.0, 0.9, 0.78]),
        ("short streamer", 5, 0.38, 0.42, [0.1, 0.5, 0.42], [0.95, 0.95, 0.85]),
    ];
    for (name, ring, below, length, dark, light) in streamers {
        let material = MeshMaterial3d(cloth.clone());
        let mesh = Mesh3d(meshes.add(streamer(below, length, dark, light)));
        // The box of a mesh does not follow its vertices.
        let mut streamer = commands.spawn((
            Moving::Streamer { below, length },
            mesh,
            material,
            NoFrustumCulling,
            Transform::default(),
        ));
        // On the upper side of a ring.
        let point = ring * POINTS + POINTS / 4;
        streamer.with_child((Moving::OnStreamer { below, length, point }, named(name, Vec3::ZERO)));
    }
}

/// Returns a point whose track is written beside the pictures, at a place on its parent.
fn named(name: &'static str, place: Vec3) -> (FilmedPoint, Transform) {
    (FilmedPoint::new(name), Transform::from_translation(place))
}

const SUN: Color = Color::srgb(1.0, 0.94, 0.84);
const WARM: Color = Color::srgb(1.0, 0.62, 0.3);

/// Moves everything to its place at a time in seconds.
pub fn place(world: &mut World, seconds: f32) {
    let turn = seconds / SECONDS;
    let loops = world.get_resource().map_or(1, |take: &Take| (take.seconds / SECONDS).round().max(1.0) as usize);
    // The part of the take that is over; a loop alone has one sun.
    let day = if loops > 1 { (turn / loops as f32).fract() } else { 0.0 };
    let mut moving = world.query::<(&Moving, &mut Transform)>();
    for (part, mut pose) in moving.iter_mut(world) {
        match *part {
            Moving::Petal(index) => *pose = petal(index, turn, loops),
            Moving::Sun => *pose = sun_pose(day),
            Moving::Flame(index) => *pose = flame(index, turn).0,
            Moving::Lantern(hook) => {
                let swing = 0.22 * (TAU * (turn + hook.x)).sin();
                pose.rotation = Quat::from_rotation_z(swing) * Quat::from_rotation_x(0.5 * swing);
                pose.translation = hook - pose.rotation * (0.13 * Vec3::Y);
            }
            Moving::Blossoms(place) => {
                let sway = Vec3::new((TAU * turn + place.y).sin(), 0.3 * (TAU * turn).cos(), (TAU * turn).cos());
                pose.translation = place + 0.018 * (place.y / CROWN.y) * sway;
            }
            Moving::OnStreamer { below, length, point } => {
                pose.translation = Vec3::from(streamer_points(below, length, turn)[point]);
            }
            Moving::Streamer { .. } | Moving::FireLight | Moving::OnPetal(_) => {}
        }
    }
    for (part, mut visibility) in world.query::<(&Moving, &mut Visibility)>().iter_mut(world) {
        if let Moving::OnPetal(index) = *part {
            let Transform { translation, scale, .. } = petal(index, turn, loops);
            // From half of its width on.
            let is_seen = translation.y > GRASS && scale.x > 0.5 * petal_size(index);
            *visibility = if is_seen { Visibility::Inherited } else { Visibility::Hidden };
        }
    }
    let flicker = 1.0 + 0.25 * (3.0 * TAU * turn).sin() + 0.12 * (7.0 * TAU * turn).cos();
    for (part, mut light) in world.query::<(&Moving, &mut PointLight)>().iter_mut(world) {
        if let Moving::FireLight = part {
            light.intensity = 26_000.0 * flicker;
        }
    }
    for mut sun in world.query::<&mut DirectionalLight>().iter_mut(world) {
        sun.color = SUN.mix(&WARM, lowness(day));
    }
    let mut cloths = world.query::<(&Moving, &Mesh3d)>();
    let streamers: Vec<_> = cloths
        .iter(world)
        .filter_map(|(part, mesh)| match *part {
            Moving::Streamer { below, length } => Some((mesh.id(), streamer_points(below, length, turn))),
            _ => None,
        })
        .collect();
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    for (mesh, points) in streamers {
        if let Some(mut mesh) = meshes.get_mut(mesh) {
            mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, points);
            mesh.compute_smooth_normals();
        }
    }
    let mut burning = world.query::<(&Moving, &MeshMaterial3d<StandardMaterial>)>();
    let flames: Vec<_> = burning
        .iter(world)
        .filter_map(|(part, material)| match *part {
            Moving::Flame(index) => Some((material.id(), flame(index, turn).1)),
            _ => None,
        })
        .collect();
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    for (material, color) in flames {
        if let Some(mut material) = materials.get_mut(material) {
            material.base_color = color;
        }
    }
}

/// Returns a number from 0 to 1 that looks random.
fn chance(index: usize, kind: u32) -> f32 {
    let mut word = (index as u32).wrapping_mul(0x9e37_79b9) ^ kind.wrapping_mul(0x85eb_ca6b);
    word = (word ^ (word >> 16)).wrapping_mul(0x7feb_352d);
    word = (word ^ (word >> 15)).wrapping_mul(0x846c_a68b);
    ((word ^ (word >> 16)) >> 8) as f32 / (1 << 24) as f32
}

/// Returns 0 at the ends of a life from 0 to 1, 1 in its middle.
fn grown(age: f32, edge: f32) -> f32 {
    let part = (age.min(1.0 - age) / edge).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// Returns how low the sun is, 0 to 1, when this part of the take is over.
fn lowness(day: f32) -> f32 {
    0.5 - 0.5 * (TAU * day).cos()
}

/// Returns where the sun shines from when this part of the take is over.
fn sun_pose(day: f32) -> Transform {
    let from = Vec3::new(2.5, 3.6 - 2.0 * lowness(day), 2.0);
    Transform::from_translation(Quat::from_rotation_y((TAU * day).sin()) * from).looking_at(Vec3::ZERO, Vec3::Y)
}

/// Returns the pose of a petal: from the crown it sails around the island, down past its rim. Of the given number of
/// loops, each has another way.
fn petal(index: usize, turn: f32, loops: usize) -> Transform {
    let begun = turn + chance(index, 11);
    let age = begun.fract();
    let way = index + PETALS * (begun as usize % loops);
    let angle = TAU * (chance(way, 12) + 0.42 * age);
    let from = CROWN + 0.3 * Vec3::new(angle.cos(), 0.4 * chance(way, 13), angle.sin());
    let far = 0.7 + 0.35 * chance(way, 14);
    let to = Vec3::new(far * angle.cos(), -0.35 - 0.25 * chance(way, 15), far * angle.sin());
    let flutter = 0.045 * Vec3::new((TAU * (2.0 * age + chance(index, 16))).sin(), 0.0, (TAU * 2.0 * age).cos());
    let gone = 1.0 - (1.0 - age).powf(1.4);
    Transform {
        translation: from.lerp(to, gone) + 0.18 * Vec3::Y * (TAU / 2.0 * age).sin() + flutter,
        rotation: Quat::from_euler(EulerRot::YXZ, angle, TAU * (2.0 * age + chance(index, 17)), TAU * age),
        scale: Vec3::new(1.0, 0.28, 0.72) * petal_size(index) * grown(age, 0.12),
    }
}

/// Returns the scale of a petal between its beginning and its end.
fn petal_size(index: usize) -> f32 {
    0.75 + 0.5 * chance(index, 18)
}

/// Returns the pose and the color of a lick of flame.
fn flame(index: usize, turn: f32) -> (Transform, Color) {
    let age = (2.0 * turn + chance(index, 21)).fract();
    let angle = TAU * (chance(index, 22) + 0.35 * age);
    let far = 0.065 * (1.0 - age) * chance(index, 23).sqrt();
    let radius = (0.018 + 0.05 * (1.0 - age)) * grown(age, 0.18).max(0.02);
    let place = FIRE + Vec3::new(far * angle.cos(), 0.02 + 0.34 * age, far * angle.sin());
    let pose = Transform { translation: place, scale: Vec3::new(0.8, 1.5, 0.8) * radius, ..default() };
    (pose, Color::srgb(1.0, 0.86 - 0.62 * age, 0.42 * (1.0 - age) * (1.0 - age)))
}

/// Returns a ball of blossoms: a sphere with bumps, in flat facets.
fn blossoms(radius: f32, index: usize) -> Mesh {
    let mut mesh: Mesh = Sphere::new(radius).mesh().ico(3).unwrap_or_else(|_| Sphere::new(radius).into());
    shift(&mut mesh, |point| {
        let wave = (point / radius * 5.0 + Vec3::splat(index as f32)).to_array().map(f32::sin);
        point * (1.0 + 0.1 * wave[0] * wave[1] + 0.08 * wave[2])
    });
    mesh.duplicate_vertices();
    mesh.compute_flat_normals();
    mesh
}

/// Returns the highest vertex of a mesh.
fn highest(mesh: &Mesh) -> Vec3 {
    let points = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|points| points.as_float3()).unwrap_or_default();
    points.iter().copied().map(Vec3::from).max_by(|a, b| a.y.total_cmp(&b.y)).unwrap_or_default()
}

/// Moves the vertices of a mesh.
fn shift(mesh: &mut Mesh, place: impl Fn(Vec3) -> Vec3) {
    if let Some(points) = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|points| points.as_float3()) {
        let points: Vec<[f32; 3]> = points.iter().map(|point| place(Vec3::from(*point)).to_array()).collect();
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, points);
    }
}

/// Returns the island: grass above, rock below, in flat facets.
fn island() -> Mesh {
    const ROUND: usize = 30;
    // Radius, height, share of the rock's bumps, of each ring from the middle of the grass to the tip of the rock.
    const PROFILE: [(f32, f32, f32); 11] = [
        (0.0, 0.02, 0.0),
        (0.35, 0.02, 0.1),
        (0.7, 0.0, 0.15),
        (0.95, -0.01, 0.25),
        (1.04, -0.05, 0.4),
        (1.0, -0.13, 0.6),
        (0.86, -0.24, 1.0),
        (0.66, -0.38, 1.0),
        (0.42, -0.55, 1.0),
        (0.2, -0.7, 0.8),
        (0.0, -0.8, 0.0),
    ];
    let mut points = Vec::new();
    let mut colors = Vec::new();
    for (ring, (radius, height, bumps)) in PROFILE.into_iter().enumerate() {
        for step in 0..ROUND {
            let (sin, cos) = (TAU * step as f32 / ROUND as f32).sin_cos();
            let bump = bumps * (chance(ring * ROUND + step, 31) - 0.5);
            let wide = radius * (1.0 + 0.05 * (3.0 * cos + 2.0 * sin * sin).sin()) + 0.17 * bump;
            points.push([wide * cos, height + 0.15 * bump, wide * sin]);
            let light = 0.85 + 0.3 * chance(ring * ROUND + step, 32);
            let color = match ring {
                0..=3 => Vec3::new(0.23, 0.42, 0.12),
                4 => Vec3::new(0.24, 0.4, 0.12),
                5 => Vec3::new(0.34, 0.25, 0.16),
                _ => Vec3::new(0.36, 0.3, 0.28),
            };
            colors.push((color * light).extend(1.0).to_array());
        }
    }
    let mut mesh = tube(points, PROFILE.len(), ROUND);
    mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, colors);
    mesh.duplicate_vertices();
    mesh.compute_flat_normals();
    mesh
}

/// Returns the mesh of rings of points, each joined to the next.
fn tube(points: Vec<[f32; 3]>, rings: usize, round: usize) -> Mesh {
    let mut corners = Vec::new();
    for ring in 1..rings {
        for step in 0..round {
            let [a, b] = [step, (step + 1) % round].map(|step| ((ring - 1) * round + step) as u32);
            let [c, d] = [a, b].map(|corner| corner + round as u32);
            corners.extend([a, b, c, b, d, c]);
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, points)
        .with_inserted_indices(Indices::U32(corners))
}

/// Returns a streamer: a carp of cloth with an eye and scales.
fn streamer(below: f32, length: f32, dark: [f32; 3], light: [f32; 3]) -> Mesh {
    let color = |ring: usize, point: usize| {
        let (along, around) = (ring as f32 / (RINGS - 1) as f32, point as f32 / POINTS as f32);
        let is_eye = (3..=4).contains(&ring) && (point == 1 || point == POINTS / 2 - 1);
        let is_light = along < 0.1
            || along > 0.2 && (ring + point).is_multiple_of(3)
            || (0.3..0.7).contains(&(around + 0.75).fract());
        match (is_eye, is_light) {
            (true, _) => [0.02, 0.02, 0.02, 1.0],
            (_, true) => [light[0], light[1], light[2], 1.0],
            _ => [dark[0], dark[1], dark[2], 1.0],
        }
    };
    let all = (0..RINGS).flat_map(|ring| (0..POINTS).map(move |point| (ring, point)));
    let colors: Vec<[f32; 4]> = all.map(|(ring, point)| color(ring, point)).collect();
    let mut mesh = tube(streamer_points(below, length, 0.0), RINGS, POINTS);
    mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, colors);
    mesh.compute_smooth_normals();
    mesh
}

/// Returns the points of a streamer in the wind, which runs along it in waves.
fn streamer_points(below: f32, length: f32, turn: f32) -> Vec<[f32; 3]> {
    let mouth = POLE - Vec3::new(0.02, below + 0.05, 0.0);
    let wind = Vec3::new(-0.92, 0.0, -0.38).normalize();
    let across = wind.cross(Vec3::Y);
    let mut points = Vec::with_capacity(RINGS * POINTS);
    for ring in 0..RINGS {
        let along = ring as f32 / (RINGS - 1) as f32;
        let phase = TAU * (1.1 * along - 2.0 * turn + 1.7 * below);
        let middle = mouth
            + wind * (length * along * 0.96)
            + across * (0.11 * length * along * phase.sin())
            + Vec3::Y * (0.1 * length * along * (phase + 1.1).cos() - 0.12 * length * along * along);
        let radius = 0.1 * length * (1.0 + 0.35 * (TAU / 2.0 * along).sin() - 0.55 * along) + 0.002;
        // The tail is flat and spread.
        let flat = ((along - 0.78) / 0.22).max(0.0);
        for point in 0..POINTS {
            let (sin, cos) = (TAU * point as f32 / POINTS as f32).sin_cos();
            let side = across * cos * radius * (1.0 - 0.9 * flat);
            let up = Vec3::Y * sin * radius * (1.0 + 1.1 * flat);
            points.push((middle + side + up).to_array());
        }
    }
    points
}
