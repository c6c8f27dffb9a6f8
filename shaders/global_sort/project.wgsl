// project: slices each Gaussian at the view's time and projects it, as the original rasterizer does.
// In: Gaussians, color coefficients, an instance, a list of active Gaussians. Out: one splat and one depth key for each
// active Gaussian; the key of an invisible splat is INVISIBLE. CPU reference: src/reference/project.rs with
// src/gaussian/projection.rs.
#import gs4d::types::{SplatRecord, DEBUG_ACTIVE, INVISIBLE}
#import gs4d::capture::{index_of, instance}
#ifdef COPIED_INSTANCE
#import gs4d::capture::instances
#endif
#import gs4d::color::seen_color
#import gs4d::projection::{debug_color, projection_of}
#import gs4d::records::{record_of, Splat}
#import gs4d::tile::pack_tiles

@group(0) @binding(1) var<storage, read_write> splats: array<SplatRecord>;
@group(0) @binding(2) var<storage, read_write> depth_keys: array<u32>;

@compute @workgroup_size(256)
fn project(@builtin(global_invocation_id) id: vec3<u32>) {
#ifdef COPIED_INSTANCE
    instance = instances[id.z].uniforms;
#endif
    if id.x >= instance.count {
        return;
    }
    let slot = instance.first_slot + id.x;
    let index = index_of(id.x);
    let p = projection_of(index);
    depth_keys[slot] = p.depth_key;
    if p.depth_key == INVISIBLE {
        return;
    }
    var color: vec3<f32>;
    if instance.debug >= DEBUG_ACTIVE {
        color = debug_color(p);
    } else {
        color = seen_color(index, p.gaussian, p.dt);
    }
    splats[slot] = record_of(Splat(p.center, p.opacity, p.depth, p.conic, color), pack_tiles(p.tiles));
}
