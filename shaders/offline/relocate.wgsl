// relocate: gives Gaussians the colors of others, and begins their moments again.
// In: moves, each from one Gaussian to another that no move to a third starts from, or to itself. Out: the colors of the others; moments are 0, those
// of the sources too unless they keep them. The raw parameters are written by the host. CPU references: src/offline/fine_tune/relocation.rs,
// src/offline/fine_tune/cloning.rs.
#import gs4d::training::RelocationUniforms

// Four-vectors of the raw parameters of each Gaussian.
const GEOMETRY: u32 = 5u;

@group(0) @binding(0) var<uniform> settings: RelocationUniforms;
// x: where to, y: where from.
@group(0) @binding(1) var<storage, read> moves: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> colors: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> first_of_colors: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> second_of_colors: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> first_of_geometry: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> second_of_geometry: array<vec4<f32>>;

fn forget_color(at: u32) {
    first_of_colors[at] = vec4(0.0);
    second_of_colors[at] = vec4(0.0);
}

fn forget_geometry(at: u32) {
    first_of_geometry[at] = vec4(0.0);
    second_of_geometry[at] = vec4(0.0);
}

@compute @workgroup_size(256)
fn relocate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let width = max(settings.stride, GEOMETRY);
    for (var i = id.x; i < settings.moves * width; i += groups.x * 256u) {
        let place = i % width;
        let to = moves[i / width].x;
        let source = moves[i / width].y;
        if place < settings.stride {
            if source != to {
                colors[to * settings.stride + place] = colors[source * settings.stride + place];
            }
            forget_color(to * settings.stride + place);
            if settings.keeps == 0u {
                forget_color(source * settings.stride + place);
            }
        }
        if place < GEOMETRY {
            forget_geometry(to * GEOMETRY + place);
            if settings.keeps == 0u {
                forget_geometry(source * GEOMETRY + place);
            }
        }
    }
}
