//! Prepare: finds the contact shadows that each camera sees.
//!
//! In: [`ExtractedContactShadows`]; Bevy's extracted cameras with their layers and fog. Out: [`ContactShadowViews`],
//! whose buffer is written to the GPU.

use super::extract::{ExtractedContactShadows, PlacedShadow};
use super::pipeline::{ContactShadowKey, ContactShadowPipeline, GpuEllipse};
use crate::plugin::render::targets::bindings::created;
use crate::plugin::render::targets::checked_pipelines::CheckedPipelines;
use bevy::camera::Camera3d;
use bevy::camera::visibility::RenderLayers;
use bevy::color::Alpha;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::log::debug_span;
use bevy::pbr::{DistanceFog, FogFalloff};
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::{BufferUsages, CachedRenderPipelineId, PipelineCache, RawBufferVec};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::{ExtractedView, Msaa};
use glam::{Mat4, Vec3};
use std::ops::Range;

/// The contact shadows of all cameras. The memory is kept from frame to frame.
#[derive(Resource)]
pub(super) struct ContactShadowViews {
    pub(super) ellipses: RawBufferVec<GpuEllipse>,
    /// The cameras that see a contact shadow, by entity in the render world.
    pub(super) cameras: HashMap<Entity, ContactShadowView>,
}

/// The contact shadows of one camera.
pub(super) struct ContactShadowView {
    pub(super) pipeline: CachedRenderPipelineId,
    /// The range of its ellipses in the buffer.
    pub(super) ellipses: Range<u32>,
}

impl Default for ContactShadowViews {
    fn default() -> Self {
        Self { ellipses: RawBufferVec::new(BufferUsages::VERTEX), cameras: HashMap::default() }
    }
}

/// Returns whether any camera sees a contact shadow, or saw one when they were last prepared.
pub(super) fn any_view(views: Res<ContactShadowViews>) -> bool {
    !views.cameras.is_empty()
}

/// Finds the contact shadows that each camera sees.
pub(super) fn prepare_contact_shadows(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    shadows: Res<ExtractedContactShadows>,
    pipeline: Res<ContactShadowPipeline>,
    cache: Res<PipelineCache>,
    mut pipelines: ResMut<CheckedPipelines<ContactShadowPipeline>>,
    mut views: ResMut<ContactShadowViews>,
    cameras: Query<(Entity, &ExtractedView, &Msaa, Option<&RenderLayers>, Option<&DistanceFog>), With<Camera3d>>,
) {
    let _span = debug_span!("gs4d/contact_shadow").entered();
    let views = &mut *views;
    views.ellipses.clear();
    views.cameras.clear();
    for (entity, view, msaa, layers, fog) in &cameras {
        let layers = layers.unwrap_or_default();
        let first = views.ellipses.len();
        let world_from_view = view.world_from_view.affine();
        let clip_from_world =
            view.clip_from_world.unwrap_or_else(|| view.clip_from_view * Mat4::from(world_from_view.inverse()));
        let camera = view.retained_view_entity.main_entity;
        let is_seen = |shadow: &&PlacedShadow| shadow.layers.intersects(layers) && shadow.in_range.of(camera);
        for shadow in shadows.0.iter().filter(is_seen) {
            views.ellipses.push(seen(shadow, &clip_from_world, world_from_view.translation.into(), fog));
        }
        let ellipses = first as u32..views.ellipses.len() as u32;
        if ellipses.is_empty() {
            continue;
        }
        let key =
            ContactShadowKey { format: view.target_format, samples: msaa.samples(), mirrored: view.invert_culling };
        let Some(pipeline) = pipelines.specialize(&device, &cache, &pipeline, key) else { continue };
        views.cameras.insert(entity, ContactShadowView { pipeline, ellipses });
    }
    if created(&device, || views.ellipses.write_buffer(&device, &queue)).is_none() {
        *views = ContactShadowViews::default();
    }
}

/// Returns a contact shadow in a camera's clip space, attenuated by fog.
fn seen(shadow: &PlacedShadow, clip_from_world: &Mat4, eye: Vec3, fog: Option<&DistanceFog>) -> GpuEllipse {
    let world_from_disk = shadow.ellipse.world_from_disk;
    let clip_from_disk = *clip_from_world * Mat4::from(world_from_disk);
    // The light of the fog in front of the ground is not shadowed.
    let clear = fog.map_or(1.0, |fog| clearness(fog, eye.distance(world_from_disk.translation.into())));
    let axes = [clip_from_disk.x_axis, clip_from_disk.z_axis, clip_from_disk.w_axis];
    GpuEllipse { axes: axes.map(|axis| axis.to_array()), look: [shadow.ellipse.strength * clear, shadow.softness] }
}

/// Returns the fraction of the light from a distance that fog transmits, as in Bevy's shaders.
fn clearness(fog: &DistanceFog, distance: f32) -> f32 {
    let amount = match fog.falloff {
        FogFalloff::Linear { start, end } => 1.0 - ((end - distance) / (end - start)).clamp(0.0, 1.0),
        FogFalloff::Exponential { density } => 1.0 - (-distance * density).exp(),
        FogFalloff::ExponentialSquared { density } => 1.0 - (-(distance * density).powi(2)).exp(),
        // The mean over the three color channels.
        FogFalloff::Atmospheric { extinction, .. } => 1.0 - (-distance * extinction).exp().element_sum() / 3.0,
    };
    1.0 - amount * fog.color.alpha()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::color::Color;

    #[test]
    fn a_contact_shadow_fades_in_fog() {
        let clearness = |falloff, alpha, distance| {
            let fog = DistanceFog { color: Color::srgba(0.5, 0.5, 0.5, alpha), falloff, ..DistanceFog::default() };
            clearness(&fog, distance)
        };
        let linear = || FogFalloff::Linear { start: 2.0, end: 6.0 };
        assert_eq!(
            [1.0, 4.0, 9.0].map(|at| clearness(linear(), 1.0, at)),
            [1.0, 0.5, 0.0],
            "linear fog hides the shadow between its start and end"
        );
        assert_eq!(clearness(linear(), 0.5, 9.0), 0.5, "fog with an alpha of 0.5 hides at most half of the shadow");
        let half = 2f32.ln();
        let others = [
            FogFalloff::Exponential { density: half / 3.0 },
            FogFalloff::ExponentialSquared { density: half.sqrt() / 3.0 },
            FogFalloff::Atmospheric { extinction: Vec3::splat(half / 3.0), inscattering: Vec3::ONE },
        ];
        for falloff in others {
            let name = format!("{falloff:?}");
            let left = clearness(falloff, 1.0, 3.0);
            assert!((left - 0.5).abs() < 1e-6, "{name}: {left} of the shadow remains, not half");
        }
    }
}
