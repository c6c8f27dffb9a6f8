//! Colliders in a game: the mesh of what is solid in a capture, for physics and navigation.
//!
//! In: a child entity of a capture with a [`CaptureCollider`], the time of the capture. Out: the mesh at that time
//! ([`ColliderState`]), which entities share; a message when another mesh takes its place; a mesh of Bevy.

use super::component::Playback;
use super::timeline::TimelineTrack;
use crate::plugin::asset::send;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, StreamedPicture};
use crate::scene::{ColliderMesh, Colliders};
use bevy::asset::{Assets, RenderAssetUsages};
use bevy::camera::visibility::Visibility;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::event::EntityEvent;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::message::{Message, MessageWriter};
use bevy::ecs::query::{Has, Without};
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::system::{Commands, Query, Res};
use bevy::log::{debug_span, warn};
use bevy::mesh::{Indices, Mesh, PrimitiveTopology};
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;
use std::sync::Arc;

/// Holds a mesh of what is solid in a capture: on a child entity of a [`GaussianCapture3d`]. Which mesh: that of what
/// moves, which changes with the time of the capture, or that of what never moves. `gs4d collide` makes both, and
/// packages store them.
///
/// The mesh is in capture space: with the default [`Transform`] it is where the capture is drawn. [`ColliderState`] has
/// it, and [`CaptureColliderChanged`] tells when it is another one. Of what moves there is one mesh for each stretch of
/// time: it is replaced, and has no velocity.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::ColliderState;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((
///         GaussianCapture3d(assets.load("dancer.gs4d")),
///         Upright,
///         children![CaptureCollider::Standing, CaptureCollider::Moving],
///     ));
/// }
///
/// /// Hands each new mesh to the physics of the game.
/// fn collide(mut changes: MessageReader<CaptureColliderChanged>, states: Query<&ColliderState>) {
///     for change in changes.read() {
///         match states.get(change.entity).ok().and_then(ColliderState::mesh) {
///             Some(mesh) => info!("{} has {} triangles", change.entity, mesh.triangles.len()),
///             None => info!("nothing of {} is solid", change.entity),
///         }
///     }
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// # bevy::ecs::system::assert_is_system(collide);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
#[require(Transform, Visibility, ColliderState)]
pub enum CaptureCollider {
    /// The mesh of what moves at the time of the capture.
    #[default]
    Moving,
    /// The mesh of what never moves.
    Standing,
}

/// The mesh of an entity with a [`CaptureCollider`], with which it is removed. The plugin updates it each frame; it
/// counts as changed only if the mesh is another one.
#[derive(Component, Reflect, Debug, Default, Clone)]
#[reflect(Component, Default, Debug, Clone)]
#[type_path = "bevy_gs4d::playback"]
pub struct ColliderState {
    /// `None` until the capture is loaded, and without colliders.
    #[reflect(ignore)]
    held: Option<Held>,
    /// What has been warned of.
    #[reflect(ignore)]
    lack: Option<Lack>,
}

/// The mesh of a [`CaptureCollider`] is another one: the first one of its capture, that of another stretch of time, one
/// of a capture that has been loaded again or replaced. Also sent when there is none any more, because the capture,
/// its asset or the [`CaptureCollider`] has been removed, or its track of a timeline shows no clip.
///
/// Sent in [`PlaybackSystems::Colliders`](super::PlaybackSystems::Colliders). Consecutive stretches may both have no
/// mesh.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// App::new().add_observer(|changed: On<CaptureColliderChanged>| info!("{}: {:?}", changed.entity, changed.stretch));
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureColliderChanged {
    /// The entity with the collider.
    pub entity: Entity,
    /// The entity of the capture, or, if the mesh has been taken away, that of the last one.
    pub capture: Entity,
    /// The index of the stretch of time, in [`Colliders::stretches`]. `None`: the mesh of what never moves, or none.
    pub stretch: Option<usize>,
}

/// What an entity holds.
#[derive(Debug, Clone)]
struct Held {
    /// The entity of the capture.
    capture: Entity,
    /// All meshes of the capture.
    colliders: Arc<Colliders>,
    part: Part,
}

/// One of the meshes of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Standing,
    /// That of a stretch; `None` if nothing moves.
    Moving(Option<usize>),
}

/// Why there is no mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lack {
    Capture,
    Colliders,
}

impl ColliderState {
    /// Returns the mesh; `None` until the capture is loaded, where nothing is solid, and while its track of a timeline
    /// shows no clip.
    pub fn mesh(&self) -> Option<&ColliderMesh> {
        let Held { colliders, part, .. } = self.held.as_ref()?;
        let mesh = match *part {
            Part::Standing => &colliders.standing,
            Part::Moving(stretch) => &colliders.stretches.get(stretch?)?.mesh,
        };
        (!mesh.is_empty()).then_some(mesh)
    }

    /// Returns the index of the stretch of time, in [`Colliders::stretches`]; `None` for what never moves.
    pub fn stretch(&self) -> Option<usize> {
        match self.held.as_ref()?.part {
            Part::Standing => None,
            Part::Moving(stretch) => stretch,
        }
    }

    /// Returns all meshes of the capture, which a game may prepare for its physics once; `None` until the capture is
    /// loaded, and without colliders. All entities of a capture share them.
    pub fn colliders(&self) -> Option<&Arc<Colliders>> {
        self.held.as_ref().map(|held| &held.colliders)
    }

    /// Returns whether both hold the same mesh of equal colliders. A capture that is loaded again may have colliders
    /// that are equal and not the same.
    fn holds_as(&self, other: &Self) -> bool {
        match (&self.held, &other.held) {
            (None, None) => true,
            (Some(a), Some(b)) => {
                a.part == b.part && (Arc::ptr_eq(&a.colliders, &b.colliders) || a.colliders == b.colliders)
            }
            _ => false,
        }
    }
}

impl Held {
    /// Returns what a collider of a capture holds `seconds` since its start.
    fn of(capture: Entity, collider: CaptureCollider, loaded: &GaussianCapture, seconds: f32) -> Result<Self, Lack> {
        let colliders = loaded.scene().colliders.clone().ok_or(Lack::Colliders)?;
        let part = match collider {
            CaptureCollider::Standing => Part::Standing,
            CaptureCollider::Moving => Part::Moving(colliders.stretch_at(loaded.time_at(seconds))),
        };
        Ok(Self { capture, colliders, part })
    }
}

/// Gives each entity with a collider the mesh of the time of its capture, and takes it from those without.
pub(super) fn update_colliders(
    captures: Res<Assets<GaussianCapture>>,
    players: Query<(
        Entity,
        &GaussianCapture3d,
        &Playback,
        Option<&StreamedPicture>,
        (Has<TimelineTrack>, &Visibility),
    )>,
    mut placed: Query<(Entity, &CaptureCollider, Option<&ChildOf>, &mut ColliderState)>,
    removed: Query<(Entity, &ColliderState), Without<CaptureCollider>>,
    mut commands: Commands,
    mut changes: MessageWriter<CaptureColliderChanged>,
) {
    let _span = debug_span!("gs4d/colliders").entered();
    for (entity, state) in &removed {
        commands.entity(entity).try_remove::<ColliderState>();
        if let Some(&Held { capture, .. }) = state.held.as_ref() {
            send(&mut commands, &mut changes, CaptureColliderChanged { entity, capture, stretch: None });
        }
    }
    for (entity, collider, parent, mut state) in &mut placed {
        let player = parent.and_then(|parent| players.get(parent.parent()).ok());
        let found = match player {
            None => Err(Lack::Capture),
            Some((capture, handle, playback, picture, (is_track, visibility))) => {
                let held = |loaded: &GaussianCapture| {
                    let is_streamed = loaded.scene().chunks.is_some();
                    let seconds = StreamedPicture::drawn(picture, is_streamed, playback.time);
                    Held::of(capture, *collider, loaded, seconds)
                };
                // A track without a clip at this time hides its entity, which keeps its capture.
                let is_there = !is_track || *visibility != Visibility::Hidden;
                captures.get(&handle.0).map(held).transpose().map(|held| held.filter(|_| is_there))
            }
        };
        let lack = found.as_ref().err().copied();
        if lack != state.lack {
            match lack {
                Some(Lack::Capture) => warn!(
                    "{entity} has a CaptureCollider and is not the child of an entity with a GaussianCapture3d, so \
                     that it has no mesh: spawn it as a child of the capture"
                ),
                Some(Lack::Colliders) => warn!(
                    "{entity} has a CaptureCollider, and the capture has no colliders, so that nothing of it is solid: \
                     `gs4d collide` makes them"
                ),
                None => {}
            }
        }
        let next = ColliderState { held: found.unwrap_or_default(), lack };
        if next.holds_as(&state) {
            *state.bypass_change_detection() = next;
            continue;
        }
        let capture = next.held.as_ref().or(state.held.as_ref()).map(|held| held.capture);
        let stretch = next.stretch();
        *state = next;
        if let Some(capture) = capture {
            send(&mut commands, &mut changes, CaptureColliderChanged { entity, capture, stretch });
        }
    }
}

/// Returns a mesh of a capture as a mesh of Bevy, to draw it or to bake navigation from it: the same points and
/// triangles, in capture space, with smooth normals. Triangles with points that do not exist are left out.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::{ColliderState, collider_mesh};
///
/// /// Shows each collider.
/// fn show(
///     changed: Query<(Entity, &ColliderState), Changed<ColliderState>>,
///     mut meshes: ResMut<Assets<Mesh>>,
///     mut commands: Commands,
/// ) {
///     for (entity, state) in &changed {
///         let mut entity = commands.entity(entity);
///         match state.mesh() {
///             Some(mesh) => entity.insert(Mesh3d(meshes.add(collider_mesh(mesh)))),
///             None => entity.remove::<Mesh3d>(),
///         };
///     }
/// }
/// # bevy::ecs::system::assert_is_system(show);
/// ```
pub fn collider_mesh(mesh: &ColliderMesh) -> Mesh {
    let exists = |triangle: &&[u32; 3]| triangle.iter().all(|&point| (point as usize) < mesh.points.len());
    let indices = mesh.triangles.iter().filter(exists).flatten().copied().collect();
    // Normals weighted by angles would be zero at triangles of some millimeters.
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, mesh.points.clone())
        .with_inserted_indices(Indices::U32(indices))
        .with_computed_area_weighted_normals()
}
