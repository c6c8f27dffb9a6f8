// slice: converts Gaussians from the trained form to the runtime form, once per training step.
// In: raw parameters. Out: the records that `project` reads. CPU reference: src/gaussian/slice.rs, in double precision.
#import gs4d::training::{TrainedRecord, TrainedScene}
#import gs4d::types::GaussianRecord
#import gs4d::trained::{opacity_of, slice_of, ROTATED_4D, STATIC_3D}

@group(0) @binding(0) var<uniform> scene: TrainedScene;
@group(0) @binding(1) var<storage, read> trained: array<TrainedRecord>;
@group(0) @binding(2) var<storage, read_write> gaussians: array<GaussianRecord>;
@group(0) @binding(3) var<storage, read_write> lifespans: array<vec2<f32>>;

@compute @workgroup_size(256)
fn slice(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= scene.count {
        return;
    }
    let raw = trained[id.x];
    let sliced = slice_of(raw, scene.model);
    var velocity = vec3(0.0);
    if scene.model == ROTATED_4D {
        velocity = sliced.c / sliced.v;
    }
    var lifespan = vec2(raw.mean.w, inverseSqrt(sliced.v + max(scene.prefilter_var, 0.0)));
    if scene.model == STATIC_3D {
        lifespan = vec2(0.0);
    }
    let a = sliced.covariance;
    gaussians[id.x] = GaussianRecord(
        vec4(raw.mean.xyz, lifespan.x),
        vec4(velocity, lifespan.y),
        vec4(a[0], a[1].y),
        vec4(a[1].z, a[2].z, opacity_of(raw.opacity_logit.x), 0.0),
    );
    lifespans[id.x] = lifespan;
}
