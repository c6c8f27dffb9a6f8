//! What pictures are for.
//!
//! In: nothing. Out: [`Purpose`], which errors of memory name.

/// What pictures are drawn for. A caller derives from it how they can be made smaller or fewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Views of a dataset, at its resolution or a fraction of it.
    Dataset,
    /// Views of a camera file or an orbit, at a requested size.
    Drawn,
    /// A requested number of views at a requested size, in which two scenes are compared.
    Verified,
    /// A requested number of directions and times, from which levels of detail are made.
    Directions,
    /// Anything else, such as a single picture.
    Other,
}
