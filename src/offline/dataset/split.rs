//! The splits of a dataset folder.
//!
//! In: a split, a folder. Out: the name of its camera file.

use std::path::Path;

/// A subset of the views of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Split {
    /// The views that a capture is trained on.
    Train,
    /// The views that a capture is evaluated on.
    Test,
    /// The third split of D-NeRF; the test views of the scene `lego`.
    Val,
}

impl Split {
    /// Every split.
    pub const ALL: [Self; 3] = [Self::Train, Self::Test, Self::Val];

    /// Returns the name of the split's camera file.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Train => "transforms_train.json",
            Self::Test => "transforms_test.json",
            Self::Val => "transforms_val.json",
        }
    }

    /// Returns the split that the original reads for this one: folders whose name ends in `lego` are evaluated on
    /// `val`, if its file is there.
    pub(crate) fn resolved(self, folder: &Path) -> Self {
        let is_lego = folder.file_name().is_some_and(|name| name.as_encoded_bytes().ends_with(b"lego"));
        let is_val = self == Self::Test && is_lego && folder.join(Self::Val.file_name()).is_file();
        if is_val { Self::Val } else { self }
    }
}
