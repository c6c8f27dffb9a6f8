//! Which files are given up to free memory.
//!
//! In: files with their bytes, the one that is needed last first, and the bytes to free. Out: the files to give up.
//!
//! The files that are needed last are taken until they are enough; then those are left that are not necessary, since a
//! file that is needed earlier may be large enough alone. What is freed beyond the need is therefore smaller than each
//! of the files, so that none of them fits into it again and is fetched at once.

/// Returns the files to give up to free `excess` bytes; `None` if all together have fewer.
pub(super) fn files_to_give_up(
    last_needed_first: impl IntoIterator<Item = (usize, u64)>,
    excess: u64,
) -> Option<Vec<usize>> {
    let mut freed: u64 = 0;
    let mut taken = Vec::new();
    let mut files = last_needed_first.into_iter();
    while freed < excess {
        let (file, bytes) = files.next()?;
        freed = freed.saturating_add(bytes);
        taken.push((file, bytes));
    }
    // The file that is needed first is spared first.
    taken.reverse();
    taken.retain(|(_, bytes)| {
        let without = freed.saturating_sub(*bytes);
        let is_necessary = without < excess;
        if !is_necessary {
            freed = without;
        }
        is_necessary
    });
    Some(taken.into_iter().rev().map(|(file, _)| file).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    #[test]
    fn the_files_that_are_needed_last_are_given_up() {
        let files = [(7, 10), (3, 10), (5, 10)];
        let given_up = |excess| files_to_give_up(files, excess);
        assert_eq!(given_up(0), Some(vec![]), "no need, no file");
        assert_eq!(given_up(10), Some(vec![7]), "the last one is enough");
        assert_eq!(given_up(11), Some(vec![7, 3]), "the last one is not enough");
        assert_eq!((given_up(30), given_up(31)), (Some(vec![7, 3, 5]), None), "all files, and too few");
    }

    #[test]
    fn files_that_are_not_necessary_are_spared() {
        assert_eq!(files_to_give_up([(0, 5), (1, 100), (2, 100)], 50), Some(vec![1]), "the large file is enough");
        assert_eq!(files_to_give_up([(0, 5), (1, 7), (2, 48)], 55), Some(vec![1, 2]), "the first is not necessary");
        assert_eq!(files_to_give_up([(0, 0), (1, 7)], 7), Some(vec![1]), "an empty file frees nothing");
    }

    #[test]
    fn no_file_that_is_given_up_fits_into_what_is_left() {
        let mut random = Random::new(5);
        for _ in 0..1000 {
            let files: Vec<(usize, u64)> = (0..1 + random.below(8)).map(|n| (n, random.below(20) as u64)).collect();
            let all: u64 = files.iter().map(|(_, bytes)| bytes).sum();
            let excess = random.below(all as usize + 1) as u64;
            let given_up = files_to_give_up(files.iter().copied(), excess).expect("all files are enough");
            let freed: u64 = given_up.iter().map(|file| files[*file].1).sum();
            assert!(freed >= excess, "{given_up:?} of {files:?} free {excess}");
            let fits = |file: &usize| files[*file].1 <= freed - excess;
            assert!(!given_up.iter().any(fits), "{given_up:?} of {files:?} for {excess}: each is necessary");
        }
    }
}
