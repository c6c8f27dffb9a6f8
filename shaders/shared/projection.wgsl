// Slicing and projection of one Gaussian, for `project` and `project_bin`. In: an index. Out: its footprint on the
// screen, as the original rasterizer computes it. CPU reference: src/gaussian/projection.rs.
#define_import_path gs4d::projection

#import gs4d::types::{DEBUG_ACTIVE, DEBUG_LIFESPAN, DEBUG_VELOCITY, INVISIBLE}
#import gs4d::records::{covariance_of, Gaussian}
#import gs4d::appearance::heat
#import gs4d::capture::{instance, load_gaussian, load_lifespan}
#import gs4d::importance::{boosted, importance_of, weight_of}
#import gs4d::conic::{conic_of, determinant_of, determinant_with_less, is_drawable, screen_covariance, LOW_PASS}
#import gs4d::tile::{contributing_tiles, tiles_of}

const FRUSTUM_CLAMP: f32 = 1.3;

// A Gaussian on the screen. Of an invisible one only the key is defined.
struct Projection {
    gaussian: Gaussian,
    // Time from the temporal mean to the time of the instance.
    dt: f32,
    // Whether the Gaussian is absent at that time; a debug view shows such Gaussians.
    absent: bool,
    // Pixels.
    center: vec2<f32>,
    // Opacity times marginal.
    opacity: f32,
    // Camera units.
    depth: f32,
    // Inverse covariance, factored.
    conic: vec3<f32>,
    // First and last + 1 tile.
    tiles: vec4<u32>,
    // Orders splats by depth; INVISIBLE.
    depth_key: u32,
}

// Returns the temporal marginal of a Gaussian `dt` after its temporal mean, without the cut-off.
fn marginal_of(dt: f32, inverse_sigma_t: f32) -> f32 {
    let z = dt * inverse_sigma_t;
    return exp(-0.5 * z * z);
}

// Returns whether a Gaussian may be visible at the time of the instance.
fn is_present(index: u32) -> bool {
    let lifespan = load_lifespan(index);
    return marginal_of(instance.time - lifespan.x, lifespan.y) > instance.marginal_cutoff || instance.debug == DEBUG_ACTIVE;
}

// Returns the depth of the mean of a Gaussian at the time of the instance, camera units.
fn mean_depth(index: u32) -> f32 {
    let g = load_gaussian(index);
    let mean = vec4(g.mean + g.velocity * (instance.time - load_lifespan(index).x), 1.0);
    return dot(instance.camera_z, mean);
}

// Projects a Gaussian at the time of the instance.
fn projection_of(index: u32) -> Projection {
    var p: Projection;
    p.depth_key = INVISIBLE;
    // The lifespan is enough to reject an absent Gaussian.
    let lifespan = load_lifespan(index);
    p.dt = instance.time - lifespan.x;
    var marginal = marginal_of(p.dt, lifespan.y);
    p.absent = marginal <= instance.marginal_cutoff;
    if p.absent {
        if instance.debug != DEBUG_ACTIVE {
            return p;
        }
        marginal = instance.marginal_cutoff;
    }
    let g = load_gaussian(index);
    p.gaussian = g;
    let mean = vec4(g.mean + g.velocity * p.dt, 1.0);
    if instance.cropped != 0u {
        let place = vec3(dot(instance.crop_x, mean), dot(instance.crop_y, mean), dot(instance.crop_z, mean));
        // The negated comparison is true for NaN, which counts as outside.
        if !all(abs(place) <= vec3(1.0)) {
            return p;
        }
    }
    let q = vec3(dot(instance.camera_x, mean), dot(instance.camera_y, mean), dot(instance.camera_z, mean));
    if q.z <= instance.near {
        return p;
    }
    let size = vec2<f32>(instance.size);
    let parallel = instance.orthographic != 0u;
    let ndc = vec2(dot(instance.clip_x, mean), dot(instance.clip_y, mean)) / select(q.z + 1e-7, 1.0, parallel);
    let center = ((ndc + 1.0) * size - 1.0) * 0.5;

    // The nesting of min and max is significant: with the field-of-view sentinel the limits are negative.
    let limit = FRUSTUM_CLAMP * instance.reach;
    let ray = select(min(limit, max(-limit, q.xy / q.z)), vec2(0.0), parallel);
    let j = instance.focal / select(q.z, 1.0, parallel);
    let mx = j.x * (instance.camera_x.xyz - ray.x * instance.camera_z.xyz);
    let my = j.y * (instance.camera_y.xyz - ray.y * instance.camera_z.xyz);
    var covariance = covariance_of(g);
    let thinned = instance.least_importance > 0.0;
    var weight = 1.0;
    if thinned {
        weight = weight_of(importance_of(g.opacity, covariance), instance.least_importance);
        if weight == 0.0 {
            return p;
        }
        covariance *= instance.growth;
    }
    let screen = screen_covariance(covariance, mx, my);
    if !is_drawable(screen) {
        return p;
    }
    let det = determinant_of(screen, covariance, mx, my);
    let mid = 0.5 * (screen.x + screen.z);
    let radius = ceil(3.0 * sqrt(mid + sqrt(max(0.1, mid * mid - det))));
    var opacity = g.opacity * marginal * instance.opacity * compensation(j, screen, det);
    if thinned {
        opacity = boosted(opacity * weight, instance.boost);
    }
    let square = tiles_of(center, radius, vec2<f32>(instance.tiles));
    let tiles = contributing_tiles(square, center, screen.xz, opacity);
    // The negated comparison is true for NaN, which counts as invisible.
    if !(tiles.z > tiles.x && tiles.w > tiles.y) {
        return p;
    }

    p.center = center;
    p.opacity = opacity;
    p.depth = q.z;
    p.conic = conic_of(screen, det);
    p.tiles = vec4<u32>(tiles);
    // Positive floats have the same order as their bits. For an orthographic camera, depths are measured from the near
    // plane, which may be behind the camera.
    p.depth_key = bitcast<u32>(select(q.z, q.z - instance.near, parallel));
    return p;
}

// Returns the factor on the opacity of a splat that compensates for a low-pass that is wider than it was in training.
// `per_unit` is in pixels per camera unit.
fn compensation(per_unit: vec2<f32>, screen: vec3<f32>, det: f32) -> f32 {
    let trained = instance.trained_variance * LOW_PASS * per_unit * per_unit;
    let wider = max(LOW_PASS - trained, vec2(0.0));
    if all(wider == vec2(0.0)) {
        // Exactly 1, independent of rounding.
        return 1.0;
    }
    return sqrt(determinant_with_less(screen, det, wider) / det);
}

// Returns the color of a projected Gaussian in the debug views of Gaussians.
fn debug_color(p: Projection) -> vec3<f32> {
    if instance.debug == DEBUG_VELOCITY {
        // Distance moved over the whole time interval; a distance of one unit is half saturated.
        let distance = p.gaussian.velocity * instance.time_span;
        return 0.5 + 0.5 * distance / (1.0 + length(distance));
    }
    if instance.debug == DEBUG_LIFESPAN {
        // A deviation of a tenth of the time interval is in the middle of the scale.
        return heat(0.25 + 0.75 / (1.0 + 0.1 * instance.time_span * p.gaussian.inverse_sigma_t));
    }
    return select(vec3(0.1, 0.8, 0.2), vec3(0.9, 0.1, 0.1), p.absent);
}
