//! Teleporting: the key is held to aim at the floor along a ballistic curve and released to teleport, during a fade to
//! black.
//!
//! In: the pose of the head, keys and buttons. Out: a new position of the body, the darkness of the view, and dots that
//! show the aim.

use super::body::{Body, Head, Moves};
use super::path::{follow, walking};
use bevy::prelude::*;

/// Radius of the floor, in meters.
pub const FLOOR_RADIUS: f32 = 8.0;
/// Speed of the throw, in meters per second.
const THROW: f32 = 6.0;
/// Gravity, in meters per second squared.
const GRAVITY: f32 = 9.8;
/// Offset from the head to the start of the throw, in meters.
const HAND: Vec3 = Vec3::new(0.15, -0.3, -0.1);
/// Time of a fade to or from black, in seconds.
const FADE: f32 = 0.12;
const DOTS: u32 = 12;

/// The state of teleporting.
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq)]
pub enum Teleport {
    #[default]
    Idle,
    /// Aiming at this position; `None` if the aim misses the floor.
    Aiming(Option<Vec3>),
    Leaving {
        to: Vec3,
        dark: f32,
    },
    Arriving {
        dark: f32,
    },
}

impl Teleport {
    /// Returns the darkness of the view, from 0 to 1.
    pub fn dark(&self) -> f32 {
        match self {
            Self::Idle | Self::Aiming(_) => 0.0,
            Self::Leaving { dark, .. } | Self::Arriving { dark } => dark.clamp(0.0, 1.0),
        }
    }

    /// Stops aiming. A teleport that has started is completed.
    pub fn stop_aiming(&mut self) {
        if matches!(self, Self::Aiming(_)) {
            *self = Self::Idle;
        }
    }
}

/// The ballistic curve of the aim.
struct Throw {
    from: Vec3,
    velocity: Vec3,
}

impl Throw {
    fn by(head: &GlobalTransform) -> Self {
        Self { from: head.transform_point(HAND), velocity: head.forward() * THROW }
    }

    fn at(&self, seconds: f32) -> Vec3 {
        self.from + self.velocity * seconds - Vec3::Y * (GRAVITY / 2.0 * seconds * seconds)
    }

    /// Returns the time until the curve reaches the height of the floor, in seconds.
    fn flight(&self) -> f32 {
        let up = self.velocity.y;
        (up + (up * up + 2.0 * GRAVITY * self.from.y.max(0.0)).sqrt()) / GRAVITY
    }

    /// Returns the point where the curve reaches the floor; `None` beyond the floor's edge.
    fn landing(&self) -> Option<Vec3> {
        let place = self.at(self.flight()).with_y(0.0);
        (place.length() < FLOOR_RADIUS).then_some(place)
    }
}

/// The mark on the floor.
#[derive(Component)]
pub struct Marker;

/// A dot at this fraction of the flight.
#[derive(Component)]
pub struct Dot(f32);

pub fn setup(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let bright = StandardMaterial { base_color: Color::srgb(0.2, 0.8, 1.0), unlit: true, ..default() };
    let material = MeshMaterial3d(materials.add(bright));
    commands.spawn((Marker, Mesh3d(meshes.add(Cylinder::new(0.25, 0.02))), material.clone(), Visibility::Hidden));
    let dot = meshes.add(Sphere::new(0.02));
    for index in 1..=DOTS {
        let dot_on_curve = Dot(index as f32 / DOTS as f32);
        commands.spawn((dot_on_curve, Mesh3d(dot.clone()), material.clone(), Visibility::Hidden));
    }
}

/// Adds aiming by keys and the teleport. Aiming is disabled while a recorded path is followed, but a teleport that has
/// started is completed, since the view would otherwise stay dark.
pub fn plugin(app: &mut App) {
    app.add_systems(Update, (aim.run_if(walking), travel).chain().before(follow).in_set(Moves))
        .add_systems(Update, show.after(Moves));
}

/// Aims while T or the right button is held; the release starts the teleport.
fn aim(
    keys: Res<ButtonInput<KeyCode>>,
    buttons: Res<ButtonInput<MouseButton>>,
    head: Single<&GlobalTransform, With<Head>>,
    mut teleport: ResMut<Teleport>,
) {
    let held = keys.pressed(KeyCode::KeyT) || buttons.pressed(MouseButton::Right);
    let next = match (*teleport, held) {
        (Teleport::Idle | Teleport::Aiming(_), true) => Teleport::Aiming(Throw::by(&head).landing()),
        (Teleport::Aiming(Some(to)), false) => Teleport::Leaving { to, dark: 0.0 },
        (Teleport::Aiming(None), false) => Teleport::Idle,
        (under_way, _) => under_way,
    };
    teleport.set_if_neq(next);
}

/// Fades the view to black, moves the head above the target, and fades the view in again.
fn travel(
    time: Res<Time>,
    head: Single<&GlobalTransform, With<Head>>,
    mut body: Single<&mut Transform, With<Body>>,
    mut teleport: ResMut<Teleport>,
) {
    let step = time.delta_secs() / FADE;
    let next = match *teleport {
        Teleport::Leaving { to, dark } if dark + step < 1.0 => Teleport::Leaving { to, dark: dark + step },
        Teleport::Leaving { to, .. } => {
            body.translation += (to - head.translation()).with_y(0.0);
            Teleport::Arriving { dark: 1.0 }
        }
        Teleport::Arriving { dark } if dark > step => Teleport::Arriving { dark: dark - step },
        Teleport::Arriving { .. } => Teleport::Idle,
        resting => resting,
    };
    teleport.set_if_neq(next);
}

/// Places the marker and the dots along the aim.
fn show(
    teleport: Res<Teleport>,
    head: Single<&GlobalTransform, With<Head>>,
    marker: Single<(&mut Transform, &mut Visibility), With<Marker>>,
    mut dots: Query<(&Dot, &mut Transform, &mut Visibility), Without<Marker>>,
) {
    let shown = |shown: bool| if shown { Visibility::Visible } else { Visibility::Hidden };
    let (mut place, mut visibility) = marker.into_inner();
    let landing = if let Teleport::Aiming(landing) = *teleport { landing } else { None };
    visibility.set_if_neq(shown(landing.is_some()));
    if let Some(landing) = landing {
        place.translation = landing;
    }
    let throw = Throw::by(&head);
    for (dot, mut place, mut visibility) in &mut dots {
        visibility.set_if_neq(shown(matches!(*teleport, Teleport::Aiming(_))));
        place.translation = throw.at(throw.flight() * dot.0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::path::{HeadPath, PathPlayer, start};
    use super::*;
    use std::time::Duration;

    /// Start position of the body; [`HEAD`] is not above it.
    const BODY: Vec3 = Vec3::new(1.0, 0.0, 0.0);
    const HEAD: Vec3 = Vec3::new(1.5, 1.6, 0.5);
    const TARGET: Vec3 = Vec3::new(3.0, 0.0, -1.0);

    /// Returns an app with a body, its head, and a teleport in the given state.
    fn app(teleport: Teleport) -> App {
        let mut app = App::new();
        app.init_resource::<Time>()
            .init_resource::<ButtonInput<KeyCode>>()
            .init_resource::<ButtonInput<MouseButton>>()
            .insert_resource(HeadPath::load(None).expect("the bundled path"))
            .insert_resource(PathPlayer { playing: false, seconds: 0.0 })
            .insert_resource(teleport)
            .add_plugins(plugin)
            .add_systems(Update, (follow.in_set(Moves), start.after(Moves)));
        app.world_mut().spawn((Body::default(), Transform::from_translation(BODY)));
        app.world_mut().spawn((Head, GlobalTransform::from_translation(HEAD)));
        app
    }

    /// Runs one update, `fades` times the length of a fade later. Returns the state of teleporting.
    fn pass(app: &mut App, fades: f32) -> Teleport {
        app.world_mut().resource_mut::<Time>().advance_by(Duration::from_secs_f32(fades * FADE));
        app.update();
        app.world_mut().resource_mut::<ButtonInput<KeyCode>>().clear();
        *app.world().resource::<Teleport>()
    }

    fn press(app: &mut App, key: KeyCode) {
        app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(key);
    }

    fn body(app: &mut App) -> Vec3 {
        let mut bodies = app.world_mut().query_filtered::<&Transform, With<Body>>();
        bodies.single(app.world()).expect("one body").translation
    }

    #[test]
    fn a_teleport_fades_out_moves_the_body_and_fades_in() {
        let mut app = app(Teleport::Leaving { to: TARGET, dark: 0.0 });
        let half = pass(&mut app, 0.5).dark();
        assert!(
            (half - 0.5).abs() < 1e-3 && body(&mut app) == BODY,
            "after half of the fade the view is half dark, not {half}, and the body has not moved"
        );
        assert_eq!(pass(&mut app, 0.6).dark(), 1.0, "the view is black when the body moves");
        let expected = BODY + (TARGET - HEAD).with_y(0.0);
        assert!(body(&mut app).abs_diff_eq(expected, 1e-6), "the head is above the target, the body at {expected}");
        let brighter = pass(&mut app, 0.25).dark();
        assert!((brighter - 0.75).abs() < 1e-3, "the view fades in to a darkness of 0.75, not {brighter}");
        assert_eq!(pass(&mut app, 0.8), Teleport::Idle, "the teleport ends after the fade");
        assert!(body(&mut app).abs_diff_eq(expected, 1e-6), "the body stays at the target");
    }

    #[test]
    fn a_teleport_is_completed_when_a_recorded_path_starts() {
        let mut app = app(Teleport::Leaving { to: TARGET, dark: 0.5 });
        press(&mut app, KeyCode::KeyP);
        pass(&mut app, 0.25);
        assert!(app.world().resource::<PathPlayer>().playing, "the path is being followed");
        for _ in 0..8 {
            pass(&mut app, 0.25);
        }
        assert_eq!(*app.world().resource::<Teleport>(), Teleport::Idle, "the teleport is completed");
    }

    #[test]
    fn aiming_ends_when_a_recorded_path_starts() {
        let mut app = app(Teleport::Idle);
        press(&mut app, KeyCode::KeyT);
        assert!(matches!(pass(&mut app, 0.25), Teleport::Aiming(_)), "holding T aims");
        press(&mut app, KeyCode::KeyP);
        assert_eq!(pass(&mut app, 0.25), Teleport::Idle, "P stops aiming");
        assert_eq!(pass(&mut app, 0.25), Teleport::Idle, "aiming stays off while T is held");
    }
}
