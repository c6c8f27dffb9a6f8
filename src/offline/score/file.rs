//! Scores on disk: one little-endian float32 for each Gaussian, in the order of the scene.
//!
//! In: a path, and the scores or the number of Gaussians. Out: the file, or its scores.

use crate::codec::CodecError;
use crate::offline::work::{FileError, write_beside};
use std::fs;
use std::io::Write;
use std::path::Path;

/// Writes scores, whole or not at all.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub fn write_scores(path: &Path, scores: &[f32]) -> Result<(), CodecError> {
    let bytes: Vec<u8> = scores.iter().flat_map(|score| score.to_le_bytes()).collect();
    write_beside(path, |file| file.write_all(&bytes))
}

/// Reads the scores of `count` Gaussians, for pruning.
///
/// # Errors
/// A file that cannot be read, has another length, or has a value that is not finite.
pub fn read_scores(path: &Path, count: usize) -> Result<Vec<f32>, FileError> {
    let bytes = fs::read(path).map_err(|error| FileError::at(path, error))?;
    if bytes.len() != count * 4 {
        let found = bytes.len();
        let message = format!(
            "{found} bytes, but scores of {count} Gaussians have {}: was it made from another checkpoint?",
            count * 4
        );
        return Err(FileError::at(path, message));
    }
    let scores = floats(&bytes);
    match scores.iter().position(|score| !score.is_finite()) {
        Some(index) => Err(FileError::at(path, format!("the score of Gaussian {index} is not finite"))),
        None => Ok(scores),
    }
}

/// Reads the scores of `count` Gaussians, as weights of their colors.
///
/// # Errors
/// A file that cannot be read, has another length, or has a value that is negative or not finite.
pub fn read_weights(path: &Path, count: usize) -> Result<Vec<f32>, FileError> {
    let bytes = fs::read(path).map_err(|error| FileError::at(path, error))?;
    let weights = floats(&bytes);
    if bytes.len() != count * 4 {
        let reason = format!("holds {} scores for a scene of {count} Gaussians", weights.len());
        return Err(FileError::at(path, reason));
    }
    if !weights.iter().all(|weight| weight.is_finite() && *weight >= 0.0) {
        return Err(FileError::at(path, "holds a score that is negative or not finite"));
    }
    Ok(weights)
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&four| f32::from_le_bytes(four)).collect()
}
