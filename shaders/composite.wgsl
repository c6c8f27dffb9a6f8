// composite: blends the captures of a view over the current contents of the view target.
//
// In: the captures' color and transmittance (premultiplied, in their blend space, linear or sRGB-encoded) for the
// pixels of the viewport; with READ_TARGET the view target. Out: the view target. Blending is done in the captures'
// blend space. A target in the same space is blended in place. A target in the other space (linear with ENCODE_TARGET,
// otherwise sRGB-encoded) is read, and the result is written to another texture. With KEEP_SAMPLES the mean of a
// pixel's samples is read; all its samples are written where there is a splat.
#import gs4d::srgb

// The largest half-precision number: an infinite pixel would spread through bloom.
const BRIGHTEST: f32 = 65504.0;

@group(0) @binding(0) var captures: texture_2d<f32>;
// Corner and size of the viewport in the target, pixels.
@group(0) @binding(1) var<uniform> viewport: vec4<u32>;
#ifdef READ_TARGET
@group(0) @binding(2) var source: texture_2d<f32>;

// The transfer functions, mirrored for negative values, so that they are inverses of each other there too.
fn encode(linear: vec3<f32>) -> vec3<f32> {
    return sign(linear) * srgb::encode(abs(linear));
}

fn decode(encoded: vec3<f32>) -> vec3<f32> {
    return sign(encoded) * srgb::decode(abs(encoded));
}

// Converts from the target's space to that of the captures, and back.
fn to_blend_space(color: vec3<f32>) -> vec3<f32> {
#ifdef ENCODE_TARGET
    return encode(color);
#else
    return decode(color);
#endif
}

fn from_blend_space(color: vec3<f32>) -> vec3<f32> {
#ifdef ENCODE_TARGET
    return decode(color);
#else
    return encode(color);
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let behind = textureLoad(source, pixel, 0);
    if any(pixel < viewport.xy) || any(pixel >= viewport.xy + viewport.zw) {
#ifdef KEEP_SAMPLES
        discard;
#endif
        return behind;
    }
    let front = textureLoad(captures, pixel - viewport.xy, 0);
    let transmittance = front.a;
    // Where there is no splat, the target is unchanged bit for bit.
    if transmittance >= 1.0 && all(front.rgb == vec3(0.0)) {
#ifdef KEEP_SAMPLES
        discard;
#endif
        return behind;
    }
    let alpha = 1.0 - transmittance * (1.0 - behind.a);
    let color = from_blend_space(front.rgb + transmittance * to_blend_space(behind.rgb));
    return vec4(min(color, vec3(BRIGHTEST)), alpha);
}
#else

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    if any(pixel < viewport.xy) || any(pixel >= viewport.xy + viewport.zw) {
        discard;
    }
    let front = textureLoad(captures, pixel - viewport.xy, 0);
    return vec4(min(front.rgb, vec3(BRIGHTEST)), 1.0 - front.a);
}
#endif
