// write_motion: writes captures to the camera's motion vectors and, with DEPTH, to the depth of its prepass, where
// their opacity is at least one half.
//
// In: the captures' motions and transmittance, and their depths, for the pixels of the viewport. Out: motion vectors,
// as fractions of the viewport to the right and down; depth values, subject to the depth test; the same values for
// every sample.

// x and y the sum of m alpha T, with m in pixels, not divided by 1 - T.
@group(0) @binding(0) var motions: texture_2d<f32>;
// Camera units: x the sum of z alpha T, not divided by 1 - T; y the depth at which T falls to one half or below, 0 if
// it never does.
@group(0) @binding(1) var depths: texture_2d<f32>;
// Corner and size of the viewport in the target, pixels.
@group(0) @binding(2) var<uniform> viewport: vec4<u32>;
// From depth-buffer value d to camera space: z = (x + y d) / (z + w d).
@group(0) @binding(3) var<uniform> lens: vec4<f32>;

struct Written {
    @location(0) motion: vec2<f32>,
#ifdef DEPTH
    @builtin(frag_depth) depth: f32,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Written {
    let pixel = vec2<u32>(position.xy);
    let inside = all(pixel >= viewport.xy) && all(pixel < viewport.xy + viewport.zw);
    let at = select(vec2(0u), pixel - viewport.xy, inside);
    let depth = textureLoad(depths, at, 0).xy;
    if !inside || depth.y == 0.0 {
        discard;
    }
    let motion = textureLoad(motions, at, 0);
    let opacity = max(1.0 - motion.a, 1e-4);
    var written: Written;
    written.motion = motion.xy / opacity / vec2<f32>(viewport.zw);
#ifdef DEPTH
#ifdef MEDIAN
    let z = depth.y;
#else
    let z = depth.x / opacity;
#endif
    written.depth = clamp((lens.x - lens.z * z) / (lens.w * z - lens.y), 0.0, 1.0);
#endif
    return written;
}
