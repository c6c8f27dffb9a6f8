//! Sockets in a game: entities that follow a named point of a capture.
//!
//! In: a child entity of a capture with a [`CaptureSocket`], the time that is drawn. Out: its [`Transform`], and
//! whether the point is there at that time ([`SocketState`]).

use super::component::Playback;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, StreamedPicture};
use crate::scene::SocketSample;
use bevy::asset::Assets;
use bevy::camera::visibility::Visibility;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::system::{Query, Res};
use bevy::log::{debug_span, warn};
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;
use glam::{Quat, Vec3};

/// Follows the socket of this name: on a child entity of a [`GaussianCapture3d`]. Props and effects are its children,
/// or components of the same entity.
///
/// Each frame, translation and rotation of its [`Transform`] become those of the socket at the time that is drawn; the
/// scale stays that of the game. The rotation is that since the time at which the socket was placed, when the axes are
/// those of the capture. `gs4d socket` places sockets, which packages store. [`SocketState`] tells whether the socket
/// is followed. Default: no name.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // In its place a mesh, a light or particles.
///     let lantern = (Name::new("lantern"), Transform::from_xyz(0.0, 0.0, -0.1));
///     commands.spawn((
///         GaussianCapture3d(assets.load("dancer.gs4d")),
///         Upright,
///         children![(CaptureSocket::new("hand"), children![lantern])],
///     ));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
#[require(Transform, Visibility, SocketState, WarnedOf)]
pub struct CaptureSocket(pub String);

impl CaptureSocket {
    /// Returns the component for the socket of this name.
    pub fn new(name: impl Into<String>) -> Self {
        Self(name.into())
    }
}

/// Whether an entity with a [`CaptureSocket`] follows its socket. The plugin updates it each frame.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
pub enum SocketState {
    /// The capture is not loaded.
    #[default]
    Waiting,
    /// It follows the socket.
    Tracked {
        /// An estimate of its distance from the true place, a standard deviation in capture units.
        error: f32,
    },
    /// The track does not reach the time that is drawn. The transform is the last one of the track that was drawn.
    Lost,
    /// The capture has no socket of this name, or the entity is not a child of a capture. The transform stays.
    Missing,
}

/// What has been warned of an entity with a [`CaptureSocket`].
#[derive(Component, Debug, Default)]
pub(super) struct WarnedOf(Option<Lack>);

/// Why a socket is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lack {
    Capture,
    Name,
}

/// Gives each entity with a socket the transform of the socket at the time of its capture.
pub(super) fn place_sockets(
    captures: Res<Assets<GaussianCapture>>,
    players: Query<(&GaussianCapture3d, &Playback, Option<&StreamedPicture>)>,
    mut placed: Query<(Entity, &CaptureSocket, Option<&ChildOf>, &mut Transform, &mut SocketState, &mut WarnedOf)>,
) {
    let _span = debug_span!("gs4d/sockets").entered();
    for (entity, CaptureSocket(name), parent, mut transform, mut state, mut warned) in &mut placed {
        let player = parent.and_then(|parent| players.get(parent.parent()).ok());
        let seen = |(handle, playback, picture): (&GaussianCapture3d, &Playback, Option<&StreamedPicture>)| {
            let capture = captures.get(&handle.0);
            let is_streamed = capture.is_some_and(|capture| capture.scene().chunks.is_some());
            (capture, StreamedPicture::drawn(picture, is_streamed, playback.time))
        };
        let found = match player.map(seen) {
            None => Err(Lack::Capture),
            Some((None, _)) => Ok(SocketState::Waiting),
            Some((Some(capture), seconds)) => sample(capture, name, seconds).map(|sample| match sample {
                None => SocketState::Lost,
                Some(SocketSample { position, rotation, error, .. }) => {
                    let (translation, rotation) = (Vec3::from(position), Quat::from_array(rotation));
                    let scale = transform.scale;
                    transform.set_if_neq(Transform { translation, rotation, scale });
                    SocketState::Tracked { error }
                }
            }),
        };
        let lack = found.err();
        if lack != warned.0 {
            warned.0 = lack;
            match lack {
                Some(Lack::Capture) => warn!(
                    "{entity} has a CaptureSocket({name:?}) and is not the child of an entity with a \
                     GaussianCapture3d, so that it stays where it is: spawn it as a child of the capture"
                ),
                Some(Lack::Name) => warn!(
                    "{entity} has a CaptureSocket({name:?}), and the capture has no socket of that name, so that it \
                     stays where it is: `gs4d info` lists sockets, `gs4d socket` places them"
                ),
                None => {}
            }
        }
        state.set_if_neq(found.unwrap_or(SocketState::Missing));
    }
}

/// Returns the frame of a socket of a capture that shows `seconds` since its start; `None` where it is lost.
fn sample(capture: &GaussianCapture, name: &str, seconds: f32) -> Result<Option<SocketSample>, Lack> {
    let scene = capture.scene();
    let socket = scene.sockets.iter().find(|socket| socket.name == name).ok_or(Lack::Name)?;
    // Rounding may lead out of the interval.
    let [first, last] = scene.trained_with.time_interval;
    Ok(socket.at(capture.time_at(seconds).max(first).min(last)))
}
