// relocate: copies the colors of some Gaussians to others, and resets their moments.
// In: moves, each from a source to a target, which is not the source of a move to another target; one part of the
// Gaussians, which may contain only one end of a move. Out: `gather` copies the colors of the sources, and sets the
// moments of the sources to 0 unless they keep them; after it has run for all parts, `scatter` writes the colors to the
// targets and sets the moments of the targets to 0. The host writes the raw parameters. CPU references:
// src/offline/train/reference/relocation.rs, src/offline/train/reference/cloning.rs.
#import gs4d::training::RelocationUniforms

// Four-vectors of the raw parameters of each Gaussian.
const GEOMETRY: u32 = 5u;

@group(0) @binding(0) var<uniform> settings: RelocationUniforms;
// x: target, y: source; indices among all Gaussians.
@group(0) @binding(1) var<storage, read> moves: array<vec2<u32>>;
// The color of each move.
@group(0) @binding(2) var<storage, read_write> moved: array<vec4<f32>>;
// Of the part.
@group(0) @binding(3) var<storage, read_write> colors: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> first_of_colors: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> second_of_colors: array<vec4<f32>>;
// Of all Gaussians.
@group(0) @binding(6) var<storage, read_write> first_of_geometry: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> second_of_geometry: array<vec4<f32>>;

// Sets the moments of one four-vector of a Gaussian to 0; `own` is its index in the part.
fn forget(own: u32, place: u32) {
    if place < settings.stride {
        first_of_colors[own * settings.stride + place] = vec4(0.0);
        second_of_colors[own * settings.stride + place] = vec4(0.0);
    }
    if place < GEOMETRY {
        first_of_geometry[(settings.first + own) * GEOMETRY + place] = vec4(0.0);
        second_of_geometry[(settings.first + own) * GEOMETRY + place] = vec4(0.0);
    }
}

@compute @workgroup_size(256)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let width = max(settings.stride, GEOMETRY);
    for (var i = id.x; i < settings.moves * width; i += groups.x * 256u) {
        let place = i % width;
        // The difference wraps if the Gaussian is before the part.
        let own = moves[i / width].y - settings.first;
        if own < settings.count {
            if place < settings.stride {
                moved[i / width * settings.stride + place] = colors[own * settings.stride + place];
            }
            if settings.keeps == 0u {
                forget(own, place);
            }
        }
    }
}

@compute @workgroup_size(256)
fn scatter(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let width = max(settings.stride, GEOMETRY);
    for (var i = id.x; i < settings.moves * width; i += groups.x * 256u) {
        let place = i % width;
        let own = moves[i / width].x - settings.first;
        if own < settings.count {
            if place < settings.stride {
                colors[own * settings.stride + place] = moved[i / width * settings.stride + place];
            }
            forget(own, place);
        }
    }
}
