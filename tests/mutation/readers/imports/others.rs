//! Files that no exporter writes.
//!
//! In: nothing. Out: the bytes of parameters of Dynamic 3D Gaussians and of a capture of splaTV.

use super::{packed, value};
use half::f16;

/// Returns the parameters of three Gaussians in five frames.
pub fn npz() -> Vec<u8> {
    let shapes = [
        ("means3D", vec![5, 3, 3]),
        ("unnorm_rotations", vec![5, 3, 4]),
        ("rgb_colors", vec![5, 3, 3]),
        ("logit_opacities", vec![3, 1]),
        ("log_scales", vec![3, 3]),
    ];
    let array = |shape: &[usize]| {
        let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}\n", sides.join(", "));
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend((0..shape.iter().product()).flat_map(|at| value(at + 1).to_le_bytes()));
        bytes
    };
    packed(shapes.iter().map(|(name, shape)| (format!("{name}.npy"), array(shape))).collect())
}

/// Returns a capture of splaTV of six splats.
pub fn splatv(curve: f32) -> Vec<u8> {
    let parts = r#"[{"type":"splat","size":384,"texwidth":4096,"texheight":1,"cameras":[{"id":0}]}]"#;
    let mut file = 0x674b_u32.to_le_bytes().to_vec();
    file.extend((parts.len() as u32).to_le_bytes());
    file.extend(parts.bytes());
    for splat in 0..6 {
        file.extend((0..3).flat_map(|at| value(splat * 7 + at).to_le_bytes()));
        let halves = |first: usize, count: usize, factor: f32| {
            (first..first + count).flat_map(move |at| f16::from_f32(value(splat * 40 + at) * factor).to_le_bytes())
        };
        file.extend(halves(0, 4, 1.0));
        file.extend([0.05, 0.1, 0.2, 0.0].into_iter().flat_map(|scale| f16::from_f32(scale).to_le_bytes()));
        file.extend([200, 100, 50, 40 * splat as u8]);
        file.extend(halves(8, 14, curve));
        file.extend([0.5, 0.25].into_iter().flat_map(|time| f16::from_f32(time).to_le_bytes()));
    }
    file
}
