// Spherical harmonics up to degree 3. CPU reference: src/gaussian/harmonics.rs.
#define_import_path gs4d::harmonics

// The next four functions return basis values 0-3, 4-7, 8-11, 12-15 in the unit direction `d`, with the constants and
// signs of 3DGS.
fn basis_first(d: vec3<f32>) -> vec4<f32> {
    return vec4(0.28209479, -0.48860251 * d.y, 0.48860251 * d.z, -0.48860251 * d.x);
}

fn basis_second(d: vec3<f32>) -> vec4<f32> {
    return vec4(
        1.0925484 * d.x * d.y,
        -1.0925484 * d.y * d.z,
        0.31539157 * (2.0 * d.z * d.z - d.x * d.x - d.y * d.y),
        -1.0925484 * d.x * d.z,
    );
}

fn basis_third(d: vec3<f32>) -> vec4<f32> {
    return vec4(
        0.5462742 * (d.x * d.x - d.y * d.y),
        -0.5900436 * d.y * (3.0 * d.x * d.x - d.y * d.y),
        2.8906114 * d.x * d.y * d.z,
        -0.4570458 * d.y * (4.0 * d.z * d.z - d.x * d.x - d.y * d.y),
    );
}

fn basis_fourth(d: vec3<f32>) -> vec4<f32> {
    return vec4(
        0.37317633 * d.z * (2.0 * d.z * d.z - 3.0 * d.x * d.x - 3.0 * d.y * d.y),
        -0.4570458 * d.x * (4.0 * d.z * d.z - d.x * d.x - d.y * d.y),
        1.4453057 * d.z * (d.x * d.x - d.y * d.y),
        -0.5900436 * d.x * (d.x * d.x - 3.0 * d.y * d.y),
    );
}

// The next four functions return derivatives of four basis values with respect to x, y and z of the direction, in the
// columns.
fn slope_first() -> mat3x4<f32> {
    let c = 0.48860251;
    return mat3x4(vec4(0.0, 0.0, 0.0, -c), vec4(0.0, -c, 0.0, 0.0), vec4(0.0, 0.0, c, 0.0));
}

fn slope_second(d: vec3<f32>) -> mat3x4<f32> {
    let a = 1.0925484;
    let b = 0.31539157;
    return mat3x4(
        vec4(a * d.y, 0.0, -2.0 * b * d.x, -a * d.z),
        vec4(a * d.x, -a * d.z, -2.0 * b * d.y, 0.0),
        vec4(0.0, -a * d.y, 4.0 * b * d.z, -a * d.x),
    );
}

fn slope_third(d: vec3<f32>) -> mat3x4<f32> {
    let c = 0.5462742;
    let e = 0.5900436;
    let f = 2.8906114;
    let h = 0.4570458;
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    return mat3x4(
        vec4(2.0 * c * d.x, -6.0 * e * d.x * d.y, f * d.y * d.z, 2.0 * h * d.x * d.y),
        vec4(-2.0 * c * d.y, -3.0 * e * (xx - yy), f * d.x * d.z, -h * (4.0 * zz - xx - 3.0 * yy)),
        vec4(0.0, 0.0, f * d.x * d.y, -8.0 * h * d.y * d.z),
    );
}

fn slope_fourth(d: vec3<f32>) -> mat3x4<f32> {
    let p = 0.37317633;
    let h = 0.4570458;
    let r = 1.4453057;
    let e = 0.5900436;
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    return mat3x4(
        vec4(-6.0 * p * d.x * d.z, -h * (4.0 * zz - 3.0 * xx - yy), 2.0 * r * d.x * d.z, -3.0 * e * (xx - yy)),
        vec4(-6.0 * p * d.y * d.z, 2.0 * h * d.x * d.y, -2.0 * r * d.y * d.z, 6.0 * e * d.x * d.y),
        vec4(p * (6.0 * zz - 3.0 * xx - 3.0 * yy), -8.0 * h * d.x * d.z, r * (xx - yy), 0.0),
    );
}

// Returns cos(2 pi n tau / T).
fn time_cosine(n: f32, tau: f32, time_span: f32) -> f32 {
    return cos(time_angle(n, tau, time_span));
}

// Returns 2 pi n tau / T, reduced to one turn: the precision of cosines beyond one turn is not guaranteed.
fn time_angle(n: f32, tau: f32, time_span: f32) -> f32 {
    let turns = n * tau / time_span;
    return 6.2831853 * (turns - round(turns));
}
