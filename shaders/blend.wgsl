// blend: front to back over each tile of 16 x 16 pixels, one workgroup each.
// In: tile ranges, pairs, splats, the depth of opaque surfaces, the background. Out: color and transmittance, expected and median
// depth. Each sample of a multisampled depth hides what is behind it from its share of the pixel. CPU reference:
// src/reference/blend.rs.
#import gs4d::types::SplatRecord
#import gs4d::records::read_splat
#import gs4d::alpha::alpha_at
#import gs4d::pixel::{begin_pixel, blend_splat, finish_pixel, frame, pass_surfaces}
#import gs4d::tile::{pixel_of, tile_index}

const BATCH: u32 = 256u;

@group(1) @binding(0) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(1) @binding(1) var<storage, read> pair_splats: array<u32>;
@group(1) @binding(2) var<storage, read> splats: array<SplatRecord>;

// Center, opacity, depth; conic; color.
var<workgroup> batch_a: array<vec4<f32>, 256>;
var<workgroup> batch_b: array<vec3<f32>, 256>;
var<workgroup> batch_c: array<vec3<f32>, 256>;
// Number of pixels of this tile that need no more splats.
var<workgroup> finished: atomic<u32>;

@compute @workgroup_size(256)
fn blend(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let at = pixel_of(tile.xy, thread);
    let position = vec2<f32>(at);
    let range = tile_ranges[tile_index(tile.xy, frame.tiles.x)];
    var pixel = begin_pixel(at);
    if thread == 0u {
        atomicStore(&finished, 0u);
    }
    workgroupBarrier();
    if pixel.done {
        atomicAdd(&finished, 1u);
    }
    for (var first = range.x; first < range.y; first += BATCH) {
        // No thread changes `finished` between these barriers, so all threads leave together.
        workgroupBarrier();
        if atomicLoad(&finished) == BATCH {
            break;
        }
        let mine = first + thread;
        if mine < range.y {
            let splat = read_splat(splats[pair_splats[mine]]);
            batch_a[thread] = vec4(splat.center, splat.opacity, splat.depth);
            batch_b[thread] = splat.conic;
            batch_c[thread] = splat.color;
        }
        workgroupBarrier();
        if pixel.done {
            continue;
        }
        for (var i = 0u; i < min(BATCH, range.y - first); i++) {
            let a = batch_a[i];
            if a.w > pixel.limit {
                pass_surfaces(&pixel, a.w);
                if pixel.done {
                    break;
                }
            }
            blend_splat(&pixel, alpha_at(batch_b[i], a.z, a.xy - position), batch_c[i], a.w);
            if pixel.done {
                break;
            }
        }
        if pixel.done {
            atomicAdd(&finished, 1u);
        }
    }
    finish_pixel(pixel, at);
}
