// composite: lays the captures of a view over what the game has drawn.
//
// In: the view target so far (linear; sRGB-encoded with ENCODED_TARGET), the captures' colour and transmittance (sRGB-encoded
// values, premultiplied) for the pixels of the viewport. Out: the view target. Blending happens in the captures' space, as trained.

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var captures: texture_2d<f32>;
// Corner and size of the viewport in the target, pixels.
@group(0) @binding(2) var<uniform> viewport: vec4<u32>;

// The sRGB transfer functions. Above 1 the power curve goes on; below 0 both are mirrored, so that one undoes the other.
fn encode(linear: vec3<f32>) -> vec3<f32> {
    let x = abs(linear);
    let curve = 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055;
    return sign(linear) * select(curve, 12.92 * x, x <= vec3(0.0031308));
}

fn decode(encoded: vec3<f32>) -> vec3<f32> {
    let x = abs(encoded);
    let curve = pow((x + 0.055) / 1.055, vec3(2.4));
    return sign(encoded) * select(curve, x / 12.92, x <= vec3(0.04045));
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let behind = textureLoad(source, pixel, 0);
    if any(pixel < viewport.xy) || any(pixel >= viewport.xy + viewport.zw) {
        return behind;
    }
    let front = textureLoad(captures, pixel - viewport.xy, 0);
    let transmittance = front.a;
    // Where no splat is, the target is left as it is, to the bit.
    if transmittance >= 1.0 && all(front.rgb == vec3(0.0)) {
        return behind;
    }
    let alpha = 1.0 - transmittance * (1.0 - behind.a);
#ifdef ENCODED_TARGET
    return vec4(front.rgb + transmittance * behind.rgb, alpha);
#else
    return vec4(decode(front.rgb + transmittance * encode(behind.rgb)), alpha);
#endif
}
