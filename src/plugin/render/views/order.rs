//! Order: splits the transparent items of a camera into items before and items after captures.
//!
//! In: Bevy's transparent phase, sorted; the captures that a camera sees; its [`OtherPasses`]. Out: [`CaptureOrders`],
//! which [`draw`](super::draw) follows. Items in front of captures are taken out of the phase while Bevy draws it.

use super::capture_views::CaptureViews;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::render::captures::extract::{ExtractedCaptures, ExtractedViewSettings};
use crate::plugin::render::settings::DepthWrite;
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

/// The other passes of cameras that captures depend on; cameras without such passes have no entry. Rewritten in every
/// frame, before captures are ordered.
#[derive(Resource, Default)]
pub(crate) struct OtherPasses(pub(crate) HashMap<RetainedViewEntity, OtherPass>);

/// The passes of one camera besides its opaque and transparent items.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(crate) struct OtherPass {
    /// Distance of the nearest mesh that refracts the picture behind it, in Bevy's measure; see [`nearest`].
    pub(crate) refracting: Option<f32>,
    /// Whether the samples of a multisampled target are resolved again after transparent items.
    pub(crate) resolves_again: bool,
}

/// The order of every camera that sees captures and items to order them with, by its entity in the render world.
#[derive(Resource, Default)]
pub(in crate::plugin::render) struct CaptureOrders {
    cameras: HashMap<Entity, CaptureOrder>,
    /// The items in front of captures while they are taken out of the phase of the camera that is being drawn.
    hidden: Vec<((Entity, MainEntity), Transparent3d)>,
}

/// Returns whether any item must be ordered with captures, or had to be in the previous frame.
pub(in crate::plugin::render) fn any_ordered(
    phases: Res<ViewSortedRenderPhases<Transparent3d>>,
    others: Res<OtherPasses>,
    orders: Res<CaptureOrders>,
) -> bool {
    !(others.0.is_empty() && orders.cameras.is_empty() && phases.values().all(|phase| phase.items.is_empty()))
}

/// Returns whether any camera draws captures before transmissive meshes.
pub(in crate::plugin::render) fn any_early(orders: Res<CaptureOrders>) -> bool {
    orders.cameras.values().any(|order| order.early)
}

/// Returns whether any camera draws transparent items after captures.
pub(in crate::plugin::render) fn any_front(orders: Res<CaptureOrders>) -> bool {
    orders.cameras.values().any(|order| order.front.is_some())
}

/// The place of the captures of one camera in its passes.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(in crate::plugin::render) struct CaptureOrder {
    /// Whether captures are drawn before transmissive meshes, and therefore before all transparent items.
    pub(in crate::plugin::render) early: bool,
    /// Index of the first item of the transparent phase that is drawn after captures; `None` if all items are drawn
    /// before, or captures are [early](Self::early).
    pub(in crate::plugin::render) front: Option<usize>,
    resolves_again: bool,
}

impl CaptureOrders {
    /// Returns the order of a camera. A camera without an entry has the order of a camera without transparent items.
    pub(in crate::plugin::render) fn of(&self, camera: Entity) -> CaptureOrder {
        self.cameras.get(&camera).copied().unwrap_or_default()
    }
}

impl CaptureOrder {
    /// Returns whether captures must be in every sample of a multisampled target, since later passes resolve again.
    pub(in crate::plugin::render) fn needs_samples(self) -> bool {
        self.early || self.resolves_again || self.front.is_some()
    }
}

/// Finds the place of each camera's captures among its transparent items, which have been sorted but not batched: the
/// center of the nearest capture. If captures write depth by request, all sorted items are drawn after them, and the
/// depth test decides.
pub(in crate::plugin::render) fn place_captures(
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

/// Returns the distance of the nearest capture that a camera sees, by the center of its bounds, in Bevy's measure,
/// which is 0 at the camera and grows towards it. A capture whose center is behind the camera, such as a room, counts
/// as the farthest: items in the room are in front of its walls.
fn nearest(captures: &ExtractedCaptures, view: &ExtractedView, visible: &RenderVisibleEntities) -> Option<f32> {
    let rangefinder = view.rangefinder3d();
    let placed = visible.get::<GaussianCapture3d>()?.iter_visible().filter_map(|(_, entity)| captures.0.get(entity));
    let shown = placed.filter(|placed| !placed.is_faded_out());
    let distances = shown.map(|placed| rangefinder.distance(&placed.center));
    distances.map(|distance| if distance < 0.0 { distance } else { f32::NEG_INFINITY }).reduce(f32::max)
}

/// Inserts an empty item before the first item that is nearer than `distance`, if there is one, and returns its index.
/// Bevy batches neighboring items, but not across the empty item.
fn mark_front(phase: &mut SortedRenderPhase<Transparent3d>, camera: Entity, distance: f32) -> Option<usize> {
    let front = phase.items.values().position(|item| item.distance > distance)?;
    // No mesh has this key.
    let key = (camera, MainEntity::from(Entity::PLACEHOLDER));
    let mark = Transparent3d {
        sorting_info: TransparentSortingInfo3d::AlwaysOnTop,
        distance,
        pipeline: CachedRenderPipelineId::INVALID,
        entity: key,
        // Not called for an empty range.
        draw_function: DrawFunctionId(0),
        batch_range: 0..0,
        extra_index: PhaseItemExtraIndex::None,
        indexed: false,
    };
    phase.items.shift_insert(front, key, mark);
    phase.transient_items.push(key);
    Some(front)
}

/// Takes the items in front of one camera's captures out of its transparent phase, until [`show_front`].
pub(in crate::plugin::render) fn hide_front(
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
        // Gizmos come first and write depth for the depth test of captures, but shaded captures have been recorded
        // before. So gizmos are drawn after them.
        let is_on_top = |item: &&Transparent3d| matches!(item.sorting_info, TransparentSortingInfo3d::AlwaysOnTop);
        for _ in 0..phase.items.values().take(front).take_while(is_on_top).count() {
            phase.items.move_index(0, marked.unwrap_or(phase.items.len()) - 1);
            front -= 1;
        }
    }
    hidden.extend(phase.items.drain(front..));
    order.front = (!hidden.is_empty()).then_some(front);
}

/// Appends the items that [`hide_front`] took out of the phase.
pub(in crate::plugin::render) fn show_front(
    camera: ViewQuery<&ExtractedView, With<Camera3d>>,
    mut phases: ResMut<ViewSortedRenderPhases<Transparent3d>>,
    mut orders: ResMut<CaptureOrders>,
) {
    if let Some(phase) = phases.get_mut(&camera.into_inner().retained_view_entity) {
        phase.items.extend(orders.hidden.drain(..));
    }
}
