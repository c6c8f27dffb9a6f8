//! Lazy tensors: the location of the values of a tensor in its storage.
//!
//! In: the arguments of torch's rebuild function. Out: a [`Tensor`], checked to be inside its storage before any
//! allocation.

/// A storage: an entry of the archive that has not been read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Storage<'a> {
    /// Name of the entry below `data/`.
    pub key: &'a str,
    /// Number of float32 values.
    pub count: u64,
}

/// A view of a storage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Tensor<'a> {
    /// The storage with the values.
    pub storage: Storage<'a>,
    /// Index of the first value.
    pub offset: u64,
    /// Extent of each axis.
    pub size: Vec<u64>,
    /// Distance of neighbors along each axis, in values.
    pub stride: Vec<u64>,
}

impl Tensor<'_> {
    /// Checks that the tensor lies within its storage, and returns its number of values.
    ///
    /// # Errors
    /// A description of the problem.
    pub(super) fn check(&self) -> Result<u64, &'static str> {
        let beyond = "reaches beyond the end of its storage";
        let count = self.size.iter().try_fold(1u64, |product, &size| product.checked_mul(size)).ok_or(beyond)?;
        // Strides of zero would make a small storage look like a tensor of any size.
        if count > self.storage.count {
            return Err("has more values than its storage");
        }
        if count > 0 {
            let last = self.size.iter().zip(&self.stride).try_fold(self.offset, |last, (&size, &stride)| {
                (size - 1).checked_mul(stride).and_then(|step| last.checked_add(step))
            });
            last.filter(|&last| last < self.storage.count).ok_or(beyond)?;
        }
        Ok(count)
    }

    /// Returns whether the values are stored one after another, the last axis innermost.
    pub(super) fn is_contiguous(&self) -> bool {
        let mut expected = 1;
        self.size.iter().zip(&self.stride).rev().all(|(&size, &stride)| {
            let fits = size == 1 || stride == expected;
            expected *= size;
            fits
        })
    }

    /// Returns the index in the storage of the value with the index `at`, counted with the last axis innermost.
    pub(super) fn place(&self, mut at: u64) -> u64 {
        let mut place = self.offset;
        for (&size, &stride) in self.size.iter().zip(&self.stride).rev() {
            place += at % size * stride;
            at /= size;
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tensor(count: u64, offset: u64, size: &[u64], stride: &[u64]) -> Tensor<'static> {
        Tensor { storage: Storage { key: "0", count }, offset, size: size.to_vec(), stride: stride.to_vec() }
    }

    #[test]
    fn a_tensor_that_reaches_beyond_its_storage_is_refused() {
        assert_eq!(tensor(6, 0, &[2, 3], &[3, 1]).check(), Ok(6), "a storage that is exactly filled");
        assert_eq!(tensor(7, 1, &[2, 3], &[3, 1]).check(), Ok(6), "an offset of one");
        assert!(tensor(6, 1, &[2, 3], &[3, 1]).check().is_err(), "an offset too large by one");
        assert!(tensor(6, 0, &[2, 3], &[4, 1]).check().is_err(), "a stride that is too large");
        assert!(
            tensor(6, 0, &[1 << 40, 3], &[0, 0]).check().is_err(),
            "strides of zero, which expand a value to any size"
        );
        assert!(
            tensor(u64::MAX, 0, &[1 << 40, 1 << 40], &[1, 1]).check().is_err(),
            "a number of values that overflows"
        );
        assert!(tensor(u64::MAX, 9, &[3, 3], &[1 << 63, 1]).check().is_err(), "an index that overflows");
        assert_eq!(tensor(0, 0, &[0, 1 << 40], &[1, 1]).check(), Ok(0), "an empty tensor");
    }

    #[test]
    fn places_follow_the_strides() {
        let transposed = tensor(6, 0, &[2, 3], &[1, 2]);
        assert!(!transposed.is_contiguous(), "the first axis is innermost");
        assert_eq!(
            (0..6).map(|at| transposed.place(at)).collect::<Vec<_>>(),
            [0, 2, 4, 1, 3, 5],
            "the indices of a transposed tensor"
        );
        assert!(tensor(6, 0, &[2, 1, 3], &[3, 99, 1]).is_contiguous(), "the stride of a single row is never used");
    }
}
