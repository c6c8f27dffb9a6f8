// write_depth: writes captures to the depth buffer of a camera or a light, where their opacity is at least one half.
//
// In: the captures' color and transmittance (not read for the median depth), and their depths, for the pixels of the
// viewport. Out: depth values, subject to the depth test; the same value for every sample: the expected depth, with
// MEDIAN the median depth, with FARTHER the farther of both.

@group(0) @binding(0) var colors: texture_2d<f32>;
// Camera units: x the sum of z alpha T, not divided by 1 - T; y the depth at which T falls to one half or below, 0 if
// it never does.
@group(0) @binding(1) var depths: texture_2d<f32>;
// Corner and size of the viewport in the target, pixels.
@group(0) @binding(2) var<uniform> viewport: vec4<u32>;
struct Lens {
    // From depth-buffer value d to camera space: z = (x + y d) / (z + w d).
    distance: vec4<f32>,
    // Width and height of a pixel of the captures, in pixels of the target.
    scale: u32,
}
@group(0) @binding(3) var<uniform> lens: Lens;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    let pixel = vec2<u32>(position.xy);
    let inside = all(pixel >= viewport.xy) && all(pixel < viewport.xy + viewport.zw);
    let at = select(vec2(0u), (pixel - viewport.xy) / lens.scale, inside);
    let depth = textureLoad(depths, at, 0).xy;
    if !inside || depth.y == 0.0 {
        discard;
    }
#ifdef MEDIAN
    let z = depth.y;
#else
    let expected = depth.x / max(1.0 - textureLoad(colors, at, 0).a, 1e-4);
#ifdef FARTHER
    let z = max(expected, depth.y);
#else
    let z = expected;
#endif
#endif
    let map = lens.distance;
    return clamp((map.x - map.z * z) / (map.w * z - map.y), 0.0, 1.0);
}
