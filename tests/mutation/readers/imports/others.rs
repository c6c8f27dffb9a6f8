//! Files that no exporter writes.
//!
//! In: nothing. Out: the bytes of parameters of Dynamic 3D Gaussians, of a capture of splaTV and of captures of
//! `GaussianSplats3D`.

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

/// Returns a capture of `GaussianSplats3D` of six splats of degree 1 at a level of compression: a full bucket of four,
/// and one of two.
pub fn ksplat(level: u16) -> Vec<u8> {
    let put = |bytes: &mut [u8], words: &[(usize, u32)]| {
        for &(index, word) in words {
            bytes[index * 4..index * 4 + 4].copy_from_slice(&word.to_le_bytes());
        }
    };
    let (mut file, mut section) = (vec![0; 4096], vec![0; 1024]);
    put(&mut file, &[(0, 0x100), (1, 1), (2, 1), (3, 6), (4, 6), (5, level.into())]);
    put(&mut section, &[(0, 6), (1, 6), (10, 1)]);
    let mut body = Vec::new();
    if level > 0 {
        put(&mut section, &[(2, 4), (3, 2), (4, 2.0_f32.to_bits()), (5, 12), (6, 32767), (8, 1), (9, 1)]);
        body.extend(2_u32.to_le_bytes());
        body.extend([0.0_f32, 0.0, 0.0, 1.0, 0.5, 0.0].into_iter().flat_map(f32::to_le_bytes));
    }
    let numbers = |values: &[f32]| -> Vec<u8> {
        let bytes = |&value: &f32| match level {
            0 => value.to_le_bytes().to_vec(),
            _ => f16::from_f32(value).to_le_bytes().to_vec(),
        };
        values.iter().flat_map(bytes).collect()
    };
    for splat in 0..6 {
        let place = [0, 1, 2].map(|axis| value(splat * 7 + axis));
        body.extend(match level {
            0 => numbers(&place),
            _ => place.iter().flat_map(|place| (((place + 1.0) * 32767.0) as u16).to_le_bytes()).collect(),
        });
        body.extend(numbers(&[0.05, 0.1, 0.2, 0.5, -0.5, 0.5, 0.5]));
        body.extend([200, 100, 50, 40 * (splat as u8 + 1)]);
        let rest: Vec<f32> = (0..9).map(|at| value(splat * 9 + at)).collect();
        body.extend(if level == 2 {
            rest.iter().map(|value| (value * 80.0 + 128.0) as u8).collect()
        } else {
            numbers(&rest)
        });
    }
    file.extend(section);
    file.extend(body);
    file
}
