//! Results of stages as bytes.
//!
//! In: a result. Out: its bytes, and the same result from them; `None` from bytes of anything else.

use super::StoreError;
use crate::codec::package::{self, WriteSettings};
use crate::scene::{FilterKind, GaussianScene, TemporalFilter};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::Cursor;

/// A result that is stored in a [`Store`](super::results::Store).
pub trait Stored: Sized {
    /// Returns the bytes.
    ///
    /// # Errors
    /// A result that cannot be written, such as a scene that its package cannot hold.
    fn encode(&self) -> Result<Vec<u8>, StoreError>;

    /// Returns the result that has these bytes; `None` if they are of something else.
    fn decode(bytes: &[u8]) -> Option<Self>;
}

impl Stored for Vec<u8> {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        Ok(self.clone())
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        Some(bytes.to_vec())
    }
}

/// Little-endian words.
impl Stored for Vec<u32> {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        Ok(self.iter().flat_map(|word| word.to_le_bytes()).collect())
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (words, rest) = bytes.as_chunks();
        rest.is_empty().then(|| words.iter().map(|&four| u32::from_le_bytes(four)).collect())
    }
}

/// Little-endian float32.
impl Stored for Vec<f32> {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        Ok(self.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        Some(Vec::<u32>::decode(bytes)?.into_iter().map(f32::from_bits).collect())
    }
}

/// The length of the bytes of the first, then those of the first, then those of the second.
impl<A: Stored, B: Stored> Stored for (A, B) {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        let first = self.0.encode()?;
        Ok([&(first.len() as u64).to_le_bytes()[..], &first, &self.1.encode()?].concat())
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (length, rest) = bytes.split_first_chunk()?;
        let (first, second) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        Some((A::decode(first)?, B::decode(second)?))
    }
}

/// A package, without loss.
impl Stored for GaussianScene {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        let mut bytes = Vec::new();
        package::write(&mut bytes, self, &WriteSettings { level: 1 })?;
        Ok(bytes)
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        package::read(Cursor::new(bytes)).ok()
    }
}

/// The bytes of a package that can be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Package(pub Vec<u8>);

impl Stored for Package {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        Ok(self.0.clone())
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        package::read(Cursor::new(bytes)).ok()?;
        Some(Self(bytes.to_vec()))
    }
}

/// Kind, segments and Gaussians of a filter, then its bits.
impl Stored for TemporalFilter {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        (Text((self.kind, self.segments, self.count)), self.to_bits()).encode()
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (Text((kind, segments, count)), bits) = <(Text<(FilterKind, u32, usize)>, Vec<u32>)>::decode(bytes)?;
        let expected = Self::words(count).checked_mul(segments as usize)?;
        (bits.len() == expected).then(|| Self::from_bits(kind, segments, count, bits))
    }
}

/// Nothing, or a byte and the value.
impl<T: Stored> Stored for Option<T> {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        self.as_ref().map_or(Ok(Vec::new()), |value| Ok([&[1], &value.encode()?[..]].concat()))
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [] => Some(None),
            [1, value @ ..] => T::decode(value).map(Some),
            _ => None,
        }
    }
}

/// A value that is stored as RON.
#[derive(Debug, Clone, PartialEq)]
pub struct Text<T>(pub T);

impl<T: Serialize + DeserializeOwned> Stored for Text<T> {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        Ok(ron::to_string(&self.0)?.into_bytes())
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        ron::de::from_bytes(bytes).ok().map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};

    fn returned<T: Stored>(value: &T) -> Option<T> {
        T::decode(&value.encode().expect("it can be stored"))
    }

    #[test]
    fn results_are_read_as_they_were_written() {
        let words = vec![1u32, 0, u32::MAX];
        assert_eq!(returned(&words), Some(words.clone()), "words");
        let floats = vec![0.5f32, -1.0];
        assert_eq!(returned(&(floats.clone(), words.clone())), Some((floats, words.clone())), "a pair");
        let text = Text(("energy".to_owned(), 7usize));
        assert_eq!(returned(&text), Some(text), "a value as text");
        let mut scene = synthesize(&SynthSettings { count: 40, ..SynthSettings::default() });
        scene.trained_with.pixel = Some(0.25);
        assert_eq!(returned(&scene), Some(scene), "a scene in the trained form");
        let filter = TemporalFilter::from_bits(FilterKind::KeyFrame, 3, 33, vec![5, 1, 6, 0, 7, 1]);
        assert_eq!(returned(&filter), Some(filter), "a temporal filter");
    }

    #[test]
    fn bytes_of_other_results_are_refused() {
        assert_eq!(Vec::<u32>::decode(b"seven b"), None, "a remainder of fewer than four bytes");
        assert_eq!(<(Vec<u8>, Vec<u8>)>::decode(&[255; 9]), None, "a length beyond the bytes");
        assert_eq!(GaussianScene::decode(b"no package"), None, "bytes without the magic of a package");
        assert_eq!(Package::decode(b"no package"), None, "bytes without the magic of a package");
        let filter = (Text((FilterKind::KeyFrame, 3u32, 33usize)), vec![5u32]).encode().expect("it can be stored");
        assert_eq!(TemporalFilter::decode(&filter), None, "too few bits");
    }
}
