// contact_shadow: darkens the ground beneath captures.
//
// In: for each shadow its ellipse, as the images in clip space of the center and of the x and z axes of the unit disk,
// and its look: strength and softness, both from 0 to 1. Out: black blended over the view target where the depth test
// passes. Each shadow is a strip of four vertices.

struct Vertex {
    @builtin(position) clip: vec4<f32>,
    // Position in the plane of the disk, whose radius is 1.
    @location(0) place: vec2<f32>,
    @location(1) @interpolate(flat) look: vec2<f32>,
}

@vertex
fn vertex(
    @builtin(vertex_index) corner: u32,
    @location(0) x: vec4<f32>,
    @location(1) z: vec4<f32>,
    @location(2) middle: vec4<f32>,
    @location(3) look: vec2<f32>,
) -> Vertex {
    // Counterclockwise, seen from above.
    let place = vec2<f32>(vec2(corner >> 1u, corner & 1u)) * 2.0 - 1.0;
    return Vertex(middle + x * place.x + z * place.y, place, look);
}

@fragment
fn fragment(vertex: Vertex) -> @location(0) vec4<f32> {
    let distance = length(vertex.place);
    // The hardest edge is one pixel wide.
    let softness = max(vertex.look.y, fwidth(distance));
    return vec4(vec3(0.0), vertex.look.x * smoothstep(0.0, softness, 1.0 - distance));
}
