//! Teleporting: aim at the floor along the path of a thrown object, let go, and arrive after a moment of darkness.
//!
//! In: the pose of the head, keys and buttons. Out: another place of the body, the darkness of the view, and dots that show the aim.

use super::body::{Body, Head, Moves};
use super::path::{follow, walking};
use bevy::prelude::*;

/// Radius of the floor, meters.
pub const FLOOR_RADIUS: f32 = 8.0;
/// Speed of the throw, meters per second.
const THROW: f32 = 6.0;
/// Gravity, meters per second squared.
const GRAVITY: f32 = 9.8;
/// From the head to the hand that throws, meters.
const HAND: Vec3 = Vec3::new(0.15, -0.3, -0.1);
/// Seconds until the view is dark, and until it is not.
const FADE: f32 = 0.12;
const DOTS: u32 = 12;

/// The state of teleporting.
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq)]
pub enum Teleport {
    #[default]
    Idle,
    /// At this place; `None` if the aim misses the floor.
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
    /// Returns the darkness of the view, 0 to 1.
    pub fn dark(&self) -> f32 {
        match self {
            Self::Idle | Self::Aiming(_) => 0.0,
            Self::Leaving { dark, .. } | Self::Arriving { dark } => dark.clamp(0.0, 1.0),
        }
    }

    /// Stops aiming. A teleport that has begun is completed.
    pub fn stop_aiming(&mut self) {
        if matches!(self, Self::Aiming(_)) {
            *self = Self::Idle;
        }
    }
}

/// A throw.
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

    /// Returns the seconds until it meets the height of the floor.
    fn flight(&self) -> f32 {
        let up = self.velocity.y;
        (up + (up * up + 2.0 * GRAVITY * self.from.y.max(0.0)).sqrt()) / GRAVITY
    }

    /// Returns where it meets the floor; `None` beyond the floor's edge.
    fn landing(&self) -> Option<Vec3> {
        let place = self.at(self.flight()).with_y(0.0);
        (place.length() < FLOOR_RADIUS).then_some(place)
    }
}

/// The mark on the floor.
#[derive(Component)]
pub struct Marker;

/// A dot at this share of the flight.
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
        let share = Dot(index as f32 / DOTS as f32);
        commands.spawn((share, Mesh3d(dot.clone()), material.clone(), Visibility::Hidden));
    }
}

/// Adds aiming by keys, and the teleport that follows. While a recorded path is followed there is no aiming, but a
/// teleport that has begun is completed, or the view would stay dark.
pub fn plugin(app: &mut App) {
    app.add_systems(Update, (aim.run_if(walking), travel).chain().before(follow).in_set(Moves))
        .add_systems(Update, show.after(Moves));
}

/// Aims while T or the right button is held; letting go starts the teleport.
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

/// Darkens the view, puts the head above the place, and brightens the view again.
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

/// Places marker and dots along the aim.
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

    /// Returns an app with a body, its head above a place beside it, and a teleport.
    const BODY: Vec3 = Vec3::new(1.0, 0.0, 0.0);
    const HEAD: Vec3 = Vec3::new(1.5, 1.6, 0.5);
    const TARGET: Vec3 = Vec3::new(3.0, 0.0, -1.0);

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
    fn travel_goes_dark_arrives_and_clears() {
        let mut app = app(Teleport::Leaving { to: TARGET, dark: 0.0 });
        let half = pass(&mut app, 0.5).dark();
        assert!((half - 0.5).abs() < 1e-3 && body(&mut app) == BODY, "half dark, {half}, and still there");
        assert_eq!(pass(&mut app, 0.6).dark(), 1.0, "all dark");
        let expected = BODY + (TARGET - HEAD).with_y(0.0);
        assert!(body(&mut app).abs_diff_eq(expected, 1e-6), "the head is above the place, the body at {expected}");
        let brighter = pass(&mut app, 0.25).dark();
        assert!((brighter - 0.75).abs() < 1e-3, "it gets brighter: {brighter}");
        assert_eq!(pass(&mut app, 0.8), Teleport::Idle, "until all is seen");
        assert!(body(&mut app).abs_diff_eq(expected, 1e-6), "from the new place");
    }

    #[test]
    fn a_recorded_way_that_begins_meanwhile_does_not_stay_dark() {
        let mut app = app(Teleport::Leaving { to: TARGET, dark: 0.5 });
        press(&mut app, KeyCode::KeyP);
        pass(&mut app, 0.25);
        assert!(app.world().resource::<PathPlayer>().playing, "the way has begun");
        for _ in 0..8 {
            pass(&mut app, 0.25);
        }
        assert_eq!(*app.world().resource::<Teleport>(), Teleport::Idle, "and is seen");
    }

    #[test]
    fn aiming_ends_when_a_recorded_way_begins() {
        let mut app = app(Teleport::Idle);
        press(&mut app, KeyCode::KeyT);
        assert!(matches!(pass(&mut app, 0.25), Teleport::Aiming(_)), "T aims");
        press(&mut app, KeyCode::KeyP);
        assert_eq!(pass(&mut app, 0.25), Teleport::Idle, "P ends it");
        assert_eq!(pass(&mut app, 0.25), Teleport::Idle, "though T is still held");
    }
}
