// Importance of a Gaussian, by which a capture is thinned, and how the Gaussians that remain are changed. In: opacity
// and covariance. Out: importance, weight, opacity. CPU reference: src/gaussian/importance.rs, src/view/thinning.rs.
#define_import_path gs4d::importance

// Gaussians fade in from the least importance to this multiple of it.
const FULL: f32 = 1.25;

// Returns opacity squared times extent, capture units.
fn importance_of(opacity: f32, c: mat3x3<f32>) -> f32 {
    let minors = vec3(
        c[0].x * c[1].y - c[0].y * c[0].y,
        c[1].y * c[2].z - c[1].z * c[1].z,
        c[0].x * c[2].z - c[0].z * c[0].z,
    );
    return opacity * opacity * sqrt(sqrt(max(minors.x + minors.y + minors.z, 0.0)));
}

// Returns the factor on the opacity of a Gaussian of this importance, from 0 to 1.
fn weight_of(importance: f32, least: f32) -> f32 {
    return clamp((importance / least - 1.0) / (FULL - 1.0), 0.0, 1.0);
}

// Returns the opacity of a splat whose transmittance is raised to the power of `boost`.
fn boosted(opacity: f32, boost: f32) -> f32 {
    return select(1.0 - pow(1.0 - min(opacity, 1.0), boost), opacity, opacity >= 1.0);
}
