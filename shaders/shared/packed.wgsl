// The packed form: records of sixteen 16-bit lanes, decoded with the ranges of their block. CPU reference:
// src/scene/packed/decode.rs; lanes.rs in the same folder lists the lanes.
#define_import_path gs4d::packed

#import gs4d::records::Gaussian

const LANE_MAX: f32 = 65535.0;
// Number of Gaussians in a block. The means of a block have a common range.
const PACKED_BLOCK: u32 = 256u;
const SHARED_RANGES: u32 = 3u;
const BLOCK_RANGES: u32 = 2u;
const ALWAYS: u32 = 65535u;

fn lanes(word: u32) -> vec2<f32> {
    return vec2(f32(word & 0xffffu), f32(word >> 16u));
}

// Decodes a Gaussian. `low` and `high` are the record, `time` and `scale` the first two shared ranges, `box_low` and
// `box_size` the ranges of the block.
fn unpack_gaussian(
    low: vec4<u32>,
    high: vec4<u32>,
    time: vec4<f32>,
    scale: vec4<f32>,
    box_low: vec4<f32>,
    box_size: vec4<f32>,
) -> Gaussian {
    let a = lanes(low.x);
    let b = lanes(low.y);
    let c = lanes(low.z);
    let d = lanes(low.w);
    var g: Gaussian;
    g.mean = box_low.xyz + vec3(a, b.x) / LANE_MAX * box_size.xyz;
    let lifespan = unpack_lifespan(low, time);
    g.mean_t = lifespan.x;
    g.velocity = vec3(0.0);
    g.inverse_sigma_t = lifespan.y;
    if (low.w >> 16u) != ALWAYS {
        let signed = (vec3(c, d.x) - 32768.0) / 32767.0;
        g.velocity = signed * abs(signed) * box_low.w * max(lifespan.y, box_size.w);
    }
    let e = lanes(high.x);
    let f = lanes(high.y);
    let h = lanes(high.z);
    let i = lanes(high.w);
    let s = exp(vec3(e, f.x) / LANE_MAX * scale.y + scale.x);
    let three = (vec3(f.y, h) / LANE_MAX * scale.z * 2.0 - 1.0) * 0.70710678;
    let q = with_largest(three, high.w >> 16u);
    // Columns of the rotation times the scales.
    let mx = s.x * vec3(
        1.0 - 2.0 * (q.z * q.z + q.w * q.w),
        2.0 * (q.y * q.z + q.x * q.w),
        2.0 * (q.y * q.w - q.x * q.z),
    );
    let my = s.y * vec3(
        2.0 * (q.y * q.z - q.x * q.w),
        1.0 - 2.0 * (q.y * q.y + q.w * q.w),
        2.0 * (q.z * q.w + q.x * q.y),
    );
    let mz = s.z * vec3(
        2.0 * (q.y * q.w + q.x * q.z),
        2.0 * (q.z * q.w - q.x * q.y),
        1.0 - 2.0 * (q.y * q.y + q.z * q.z),
    );
    let row_x = mx.x * mx + my.x * my + mz.x * mz;
    let row_y = mx.y * mx + my.y * my + mz.y * mz;
    let row_z = mx.z * mx + my.z * my + mz.z * mz;
    g.covariance_a = vec4(row_x, row_y.y);
    g.covariance_b = vec2(row_y.z, row_z.z);
    g.opacity = clamp(i.x / LANE_MAX * scale.w, 0.0, 1.0);
    return g;
}

// Decodes mean_t and inverse_sigma_t from the first half of a record.
fn unpack_lifespan(low: vec4<u32>, time: vec4<f32>) -> vec2<f32> {
    let mean_t = time.x + f32(low.y >> 16u) / LANE_MAX * time.y;
    let inverse = exp(-(time.z + f32(low.w >> 16u) / LANE_MAX * time.w));
    return vec2(mean_t, select(inverse, 0.0, (low.w >> 16u) == ALWAYS));
}

// Returns the unit quaternion (w, x, y, z) whose largest component was left out.
fn with_largest(three: vec3<f32>, largest: u32) -> vec4<f32> {
    let rest = sqrt(max(0.0, 1.0 - dot(three, three)));
    if largest == 0u {
        return vec4(rest, three);
    }
    if largest == 1u {
        return vec4(three.x, rest, three.yz);
    }
    if largest == 2u {
        return vec4(three.xy, rest, three.z);
    }
    return vec4(three, rest);
}

// Decodes the DC coefficient of a coded color: ten bits for each channel.
fn unpack_base(word: u32, base: vec4<f32>) -> vec3<f32> {
    let parts = vec3(f32(word & 1023u), f32((word >> 10u) & 1023u), f32((word >> 20u) & 1023u));
    return base.x + parts / 1023.0 * base.y;
}
