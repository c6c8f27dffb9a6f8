// The Gaussians of one part of a capture and the instance in which they are drawn, for the passes that read them. In:
// an index. Out: a Gaussian, read in single precision or unpacked (PACKED_GEOMETRY).
#define_import_path gs4d::capture

#import gs4d::types::{GaussianRecord, InstanceUniforms}
#import gs4d::records::{read_gaussian, Gaussian}
#ifdef PACKED_GEOMETRY
#import gs4d::packed::{unpack_gaussian, unpack_lifespan, BLOCK_RANGES, PACKED_BLOCK, SHARED_RANGES}
#endif

#ifdef COPIED_INSTANCE
// One dispatch for several instances of a capture, one for each z of its workgroups: the entry point copies the
// uniforms of its instance. Also for drivers that recompile a pass for each dispatch if a branch depends only on
// uniforms at constant offsets.
struct InstanceSlot {
    uniforms: InstanceUniforms,
    // Padding to 512 bytes, the distance of dynamic offsets.
    padding: array<vec4<u32>, 12>,
}
@group(0) @binding(0) var<uniform> instances: array<InstanceSlot, 64>;
var<private> instance: InstanceUniforms;
#else
@group(0) @binding(0) var<uniform> instance: InstanceUniforms;
#endif
#ifdef PACKED_GEOMETRY
// Two four-vectors for each Gaussian.
@group(1) @binding(0) var<storage, read> records: array<vec4<u32>>;
@group(1) @binding(1) var<storage, read> ranges: array<vec4<f32>>;
#else
@group(1) @binding(0) var<storage, read> gaussians: array<GaussianRecord>;
// A copy of mean_t and inverse_sigma_t of each Gaussian: most Gaussians of a long capture are absent, and of those only
// the copy is read.
@group(1) @binding(1) var<storage, read> lifespans: array<vec2<f32>>;
#endif
// The lists that `activate` writes, that of this instance from `first_listed` on; read only with a filter.
@group(2) @binding(0) var<storage, read> active_list: array<u32>;

// Returns the index of the Gaussian of a slot of this part.
fn index_of(slot: u32) -> u32 {
    if instance.listed != 0u {
        return active_list[instance.first_listed + slot];
    }
    return slot;
}

// Returns mean_t and inverse_sigma_t.
fn load_lifespan(index: u32) -> vec2<f32> {
#ifdef PACKED_GEOMETRY
    return unpack_lifespan(records[2u * index], ranges[0]);
#else
    // A list contains few absent Gaussians, and they are scattered in memory: the records are read anyway.
    if instance.listed != 0u {
        return vec2(gaussians[index].mean.w, gaussians[index].velocity.w);
    }
    return lifespans[index];
#endif
}

fn load_gaussian(index: u32) -> Gaussian {
#ifdef PACKED_GEOMETRY
    let block = SHARED_RANGES + index / PACKED_BLOCK * BLOCK_RANGES;
    let low = records[2u * index];
    let high = records[2u * index + 1u];
    return unpack_gaussian(low, high, ranges[0], ranges[1], ranges[block], ranges[block + 1u]);
#else
    return read_gaussian(gaussians[index]);
#endif
}

// Returns the direction from which the instance's camera sees a Gaussian `dt` after its temporal mean.
fn viewing_direction(g: Gaussian, dt: f32) -> vec3<f32> {
    if instance.orthographic != 0u {
        return instance.camera_position;
    }
    var seen = g.mean;
    if instance.displaced != 0u {
        seen += g.velocity * dt;
    }
    return normalize(seen - instance.camera_position);
}
