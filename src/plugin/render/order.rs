//! Order: which transparent things of a camera are drawn before captures, and which after them.
//!
//! In: Bevy's transparent phase, sorted; the captures that a camera sees; what [`OtherPasses`] says of the rest of its passes. Out:
//! [`CaptureOrders`], which [`draw`](super::draw) follows. What stands in front of captures is taken out of the phase while Bevy draws it.

use super::capture_views::CaptureViews;
use super::extract::{ExtractedCaptures, ExtractedViewSettings};
use super::settings::DepthWrite;
use crate::plugin::component::GaussianCapture3d;
use bevy::camera::Camera3d;
use bevy::core_pipeline::core_3d::{Transparent3d, TransparentSortingInfo3d};
use bevy::core_pipeline::oit::OrderIndependentTransparencySettings;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{Has, With};
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::platform::collections::HashMap;
use bevy::render::render_phase::{DrawFunctionId, PhaseItemExtraIndex, SortedRenderPhase, ViewSortedRenderPhases};
use bevy::render::render_resource::CachedRenderPipelineId;
use bevy::render::renderer::ViewQuery;
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, RenderVisibleEntities, RetainedViewEntity};

/// What cameras draw besides opaque and transparent things, as far as captures depend on it; cameras without any of it are missing.
/// Written anew in every frame, before captures are placed.
#[derive(Resource, Default)]
pub(crate) struct OtherPasses(pub(crate) HashMap<RetainedViewEntity, OtherPass>);

/// What one camera draws besides opaque and transparent things.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(crate) struct OtherPass {
    /// Where the nearest mesh stands that shows, refracted, what has been drawn before it: in Bevy's measure, which grows towards the
    /// camera.
    pub(crate) refracting: Option<f32>,
    /// Whether the samples of a multisampled target are resolved again after transparent things.
    pub(crate) resolves_again: bool,
}

/// The order of every camera that sees captures among other things to be ordered, by its entity in the render world.
#[derive(Resource, Default)]
pub(super) struct CaptureOrders {
    cameras: HashMap<Entity, CaptureOrder>,
    /// What is in front of captures, while it is not in the phase of the camera that is being drawn.
    hidden: Vec<((Entity, MainEntity), Transparent3d)>,
}

/// Returns whether there is anything for captures to be ordered with, or was in the last frame.
pub(super) fn any_ordered(
    phases: Res<ViewSortedRenderPhases<Transparent3d>>,
    others: Res<OtherPasses>,
    orders: Res<CaptureOrders>,
) -> bool {
    !(others.0.is_empty() && orders.cameras.is_empty() && phases.values().all(|phase| phase.items.is_empty()))
}

/// Returns whether any camera draws captures before transmissive meshes.
pub(super) fn any_early(orders: Res<CaptureOrders>) -> bool {
    orders.cameras.values().any(|order| order.early)
}

/// Returns whether any camera draws something transparent after captures.
pub(super) fn any_front(orders: Res<CaptureOrders>) -> bool {
    orders.cameras.values().any(|order| order.front.is_some())
}

/// When the captures of one camera are drawn.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct CaptureOrder {
    /// Whether they are drawn before transmissive meshes, and so before everything transparent.
    pub(super) early: bool,
    /// The first item of the transparent phase that is drawn after them; `None` if all are drawn before, or captures are
    /// [early](Self::early).
    pub(super) front: Option<usize>,
    resolves_again: bool,
}

impl CaptureOrders {
    /// Returns the order of a camera; of one without captures, that of a camera without anything transparent.
    pub(super) fn of(&self, camera: Entity) -> CaptureOrder {
        self.cameras.get(&camera).copied().unwrap_or_default()
    }
}

impl CaptureOrder {
    /// Returns whether captures must be in every sample of a multisampled target, because later passes resolve them again.
    pub(super) fn needs_samples(self) -> bool {
        self.early || self.resolves_again || self.front.is_some()
    }
}

/// Finds the place of each camera's captures among its transparent things, which have been sorted but not batched: that of the nearest
/// capture's centre. If captures are asked to write depth, everything that has a place is in front of them, and depth decides.
pub(super) fn place_captures(
    captures: Res<ExtractedCaptures>,
    settings: Res<ExtractedViewSettings>,
    others: Res<OtherPasses>,
    mut phases: ResMut<ViewSortedRenderPhases<Transparent3d>>,
    mut orders: ResMut<CaptureOrders>,
    cameras: Query<
        (Entity, &ExtractedView, &RenderVisibleEntities, Has<OrderIndependentTransparencySettings>),
        With<Camera3d>,
    >,
) {
    orders.cameras.clear();
    for (camera, view, visible, is_order_independent) in &cameras {
        let Some(distance) = nearest(&captures, view, visible) else { continue };
        let Some(phase) = phases.get_mut(&view.retained_view_entity) else { continue };
        let other = others.0.get(&view.retained_view_entity).copied().unwrap_or_default();
        let settings = settings.0.get(&view.retained_view_entity.main_entity);
        let writes_depth =
            settings.is_some_and(|settings| matches!(settings.depth, DepthWrite::Expected | DepthWrite::Median));
        let early = other.refracting.is_some_and(|mesh| mesh > distance);
        let front = if early || is_order_independent {
            None
        } else {
            mark_front(phase, camera, if writes_depth { f32::NEG_INFINITY } else { distance })
        };
        let order = CaptureOrder { early, front, resolves_again: other.resolves_again };
        if order != CaptureOrder::default() || !phase.items.is_empty() {
            orders.cameras.insert(camera, order);
        }
    }
}

/// Returns where the nearest capture stands that a camera sees, by the centre of its bounds: in Bevy's measure, which is 0 at the camera
/// and grows towards it. A centre behind the camera, as of a room, says nothing: what is in the room is before its walls.
fn nearest(captures: &ExtractedCaptures, view: &ExtractedView, visible: &RenderVisibleEntities) -> Option<f32> {
    let rangefinder = view.rangefinder3d();
    let placed = visible.get::<GaussianCapture3d>()?.iter_visible().filter_map(|(_, entity)| captures.0.get(entity));
    let shown = placed.filter(|placed| !placed.is_faded_out());
    let distances = shown.map(|placed| rangefinder.distance(&placed.center));
    distances.map(|distance| if distance < 0.0 { distance } else { f32::NEG_INFINITY }).reduce(f32::max)
}

/// Inserts an item that draws nothing before the first that is nearer than `distance`, if there is one, and returns its index. Bevy
/// draws neighbours together if it can, but not across it.
fn mark_front(phase: &mut SortedRenderPhase<Transparent3d>, camera: Entity, distance: f32) -> Option<usize> {
    let front = phase.items.values().position(|item| item.distance > distance)?;
    // No mesh is that entity's.
    let key = (camera, MainEntity::from(Entity::PLACEHOLDER));
    let mark = Transparent3d {
        sorting_info: TransparentSortingInfo3d::AlwaysOnTop,
        distance,
        pipeline: CachedRenderPipelineId::INVALID,
        entity: key,
        // Not asked for an empty range.
        draw_function: DrawFunctionId(0),
        batch_range: 0..0,
        extra_index: PhaseItemExtraIndex::None,
        indexed: false,
    };
    phase.items.shift_insert(front, key, mark);
    phase.transient_items.push(key);
    Some(front)
}

/// Takes what is in front of one camera's captures out of its transparent phase, until [`show_front`].
pub(super) fn hide_front(
    camera: ViewQuery<&ExtractedView, With<Camera3d>>,
    views: Res<CaptureViews>,
    mut phases: ResMut<ViewSortedRenderPhases<Transparent3d>>,
    mut orders: ResMut<CaptureOrders>,
) {
    let entity = camera.entity();
    let CaptureOrders { cameras, hidden } = &mut *orders;
    let phase = phases.get_mut(&camera.into_inner().retained_view_entity);
    let (Some(order), Some(phase)) = (cameras.get_mut(&entity), phase) else { return };
    let marked = order.front.take();
    let Some(seen) = views.0.get(&entity).filter(|seen| seen.sees_something() && !order.early) else { return };
    let mut front = marked.unwrap_or(phase.items.len());
    if seen.is_shaded {
        // Gizmos come first and write depth, by which captures are cut; but these have been recorded before.
        let is_on_top = |item: &&Transparent3d| matches!(item.sorting_info, TransparentSortingInfo3d::AlwaysOnTop);
        for _ in 0..phase.items.values().take(front).take_while(is_on_top).count() {
            phase.items.move_index(0, marked.unwrap_or(phase.items.len()) - 1);
            front -= 1;
        }
    }
    hidden.extend(phase.items.drain(front..));
    order.front = (!hidden.is_empty()).then_some(front);
}

/// Puts back what [`hide_front`] has taken out, at its end.
pub(super) fn show_front(
    camera: ViewQuery<&ExtractedView, With<Camera3d>>,
    mut phases: ResMut<ViewSortedRenderPhases<Transparent3d>>,
    mut orders: ResMut<CaptureOrders>,
) {
    if let Some(phase) = phases.get_mut(&camera.into_inner().retained_view_entity) {
        phase.items.extend(orders.hidden.drain(..));
    }
}
