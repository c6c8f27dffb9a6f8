//! Sound files in WAV.
//!
//! In: samples of 16 bits, interleaved. Out: the bytes of a file.

/// Returns a file of these samples.
pub fn wave(channels: u16, rate: u32, samples: &[i16]) -> Vec<u8> {
    let data: Vec<u8> = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
    let frame = 2 * channels;
    let mut file = b"RIFF".to_vec();
    file.extend((36 + data.len() as u32).to_le_bytes());
    file.extend(b"WAVEfmt ");
    file.extend(16u32.to_le_bytes());
    file.extend([1, channels].map(u16::to_le_bytes).as_flattened());
    file.extend([rate, rate * u32::from(frame)].map(u32::to_le_bytes).as_flattened());
    file.extend([frame, 16].map(u16::to_le_bytes).as_flattened());
    file.extend(b"data");
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(data);
    file
}
