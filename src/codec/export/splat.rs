//! `.splat` files: 32 bytes for each Gaussian at rest, without a header.
//!
//! In: [`Columns`]. Out: mean and scales as floats, color and opacity as four bytes, the rotation as four bytes; -Y up.

use super::clip::Clip;
use super::y_up::y_down;
use crate::codec::import::columns::{Columns, SH_C0, sigmoid};
use glam::Vec4;
use std::io::{self, Write};

/// Writes Gaussians at rest.
///
/// # Errors
/// Errors of the writer.
pub(super) fn write(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let columns = &*y_down(columns, clip.up)?;
    for index in 0..columns.len() {
        let mut record = [0; 32];
        let scale = columns.log_scale[index].map(f32::exp);
        for (bytes, value) in record.chunks_exact_mut(4).zip(columns.mean[index].into_iter().chain(scale)) {
            bytes.copy_from_slice(&value.to_le_bytes());
        }
        let colors = columns.harmonics.of(index);
        for channel in 0..3 {
            record[24 + channel] = byte(0.5 + SH_C0 * colors[channel]);
        }
        record[27] = byte(sigmoid(columns.opacity_logit[index]));
        let rotation = Vec4::from(columns.rotation[index]).normalize_or(Vec4::X);
        for (byte, component) in record[28..].iter_mut().zip(rotation.to_array()) {
            *byte = (component * 128.0 + 128.0).round().clamp(0.0, 255.0) as u8;
        }
        writer.write_all(&record)?;
    }
    Ok(())
}

/// Returns the byte of a value from 0 to 1.
fn byte(value: f32) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}
