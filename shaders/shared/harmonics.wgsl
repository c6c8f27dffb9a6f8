// Spherical harmonics up to degree 3. CPU reference: src/gaussian/harmonics.rs.
#define_import_path gs4d::harmonics

// Return basis values 0-3, 4-7, 8-11, 12-15 in the unit direction `d`, with the constants and signs of 3DGS.
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

// Returns cos(2 pi n tau / T).
fn time_cosine(n: f32, tau: f32, time_span: f32) -> f32 {
    return cos(time_angle(n, tau, time_span));
}

// Returns 2 pi n tau / T, reduced to one turn: drivers guarantee little precision beyond it.
fn time_angle(n: f32, tau: f32, time_span: f32) -> f32 {
    let turns = n * tau / time_span;
    return 6.2831853 * (turns - round(turns));
}
