// dropout: hides a random share of the Gaussians from the views of a training step.
// In: the records that `slice` wrote of one part, the seed of the step. Out: the same records, those of the share
// without opacity. CPU reference: src/offline/train/reference/dropout.rs.
#import gs4d::training::DropoutUniforms
#import gs4d::types::GaussianRecord
#import gs4d::random::word_of

@group(0) @binding(0) var<uniform> settings: DropoutUniforms;
@group(0) @binding(1) var<storage, read_write> gaussians: array<GaussianRecord>;

@compute @workgroup_size(256)
fn dropout(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < settings.count && word_of(settings.first + id.x, settings.seed) < settings.below {
        gaussians[id.x].covariance_b.z = 0.0;
    }
}
