// statistics: the gradients on the screen by which Gaussians are cloned or split.
// In: for each Gaussian, the number of views of the batch that show it, and the sum of the lengths of the gradients of
// its center in them. Out: the mean of these, added to the sum over steps; the number of steps in which it was shown.
// CPU reference of the gradients: src/reference/blend_backward.rs.

// The same value as in `project_backward`, which writes the notes.
const FIRST_SEEN: u32 = 3u;

// From FIRST_SEEN on, a word for each Gaussian: the number of views; then a number for each: the sum of the lengths.
@group(0) @binding(0) var<storage, read> notes: array<u32>;
// x: sum over steps; y: number of steps.
@group(0) @binding(1) var<storage, read_write> statistics: array<vec2<f32>>;

@compute @workgroup_size(256)
fn statistics_of_step(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = arrayLength(&statistics);
    if id.x >= count {
        return;
    }
    let views = notes[FIRST_SEEN + id.x];
    if views > 0u {
        let length = bitcast<f32>(notes[FIRST_SEEN + count + id.x]);
        statistics[id.x] += vec2(length / f32(views), 1.0);
    }
}
