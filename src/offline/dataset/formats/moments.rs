//! Frames that a file lists moment by moment, with one name for each camera.
//!
//! In: the names of the frames of each moment. Out: the times of the moments, at 30 frames a second: by the numbers of
//! the frames, else by the order of the moments, with a sentence that says so.

use super::files::with_slashes;
use super::numbered::{FRAME_RATE, number};
use std::path::Path;

/// The sentence about frames without numbers.
const COUNTED: &str = "the names of its frames have no numbers that are the same for all cameras of a moment and \
                       ascend: moments are taken to follow each other without gaps";

/// Returns the times of the moments of each file, seconds, and a sentence if the numbers of the frames do not tell
/// them. The first moment of all files is time 0.
pub(crate) fn times<N: AsRef<str>>(files: &[&[Vec<N>]]) -> (Vec<Vec<f64>>, Option<String>) {
    let numbered: Option<Vec<Vec<u64>>> = files.iter().map(|moments| numbers(moments)).collect();
    let Some(numbered) = numbered else {
        let counted = files.iter().map(|moments| (0..moments.len() as u64).map(seconds).collect::<Vec<f64>>());
        return (counted.collect(), Some(COUNTED.to_owned()));
    };
    let first = numbered.iter().flatten().copied().min().unwrap_or(0);
    let of_file = |numbers: &Vec<u64>| numbers.iter().map(|number| seconds(number - first)).collect::<Vec<f64>>();
    (numbered.iter().map(of_file).collect(), None)
}

fn seconds(frames: u64) -> f64 {
    frames as f64 / FRAME_RATE
}

/// Returns the numbers of moments: those of their frames.
fn numbers<N: AsRef<str>>(moments: &[Vec<N>]) -> Option<Vec<u64>> {
    let numbers = moments.iter().map(|names| {
        let mut numbers = names.iter().map(|name| only_number(name.as_ref()));
        let first = numbers.next()??;
        numbers.all(|number| number == Some(first)).then_some(first)
    });
    let numbers: Vec<u64> = numbers.collect::<Option<_>>()?;
    numbers.is_sorted_by(|a, b| a < b).then_some(numbers)
}

/// Returns the number at the end of a name, without the folders before it, if it is the only one in it.
fn only_number(name: &str) -> Option<u64> {
    let name = with_slashes(name);
    let path = Path::new(&*name);
    let digits = path.file_stem()?.to_str()?.trim_start_matches(|c: char| !c.is_ascii_digit());
    if digits.bytes().all(|byte| byte.is_ascii_digit()) { number(path) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(names: &[[&str; 2]]) -> Vec<Vec<String>> {
        names.iter().map(|names| names.map(str::to_owned).into()).collect()
    }

    #[test]
    fn numbers_of_frames_tell_the_times_of_all_files() {
        let train = moments(&[["1/000003.jpg", "2/f3.png"], ["1/000006.jpg", "2\\f6.png"]]);
        let test = moments(&[["0/000000.jpg", "9/000000.jpg"]]);
        let (found, note) = times(&[&train, &test]);
        assert_eq!(found, [vec![0.1, 0.2], vec![0.0]], "gaps keep their time, and the first of all is time 0");
        assert_eq!(note, None, "nothing is assumed");
        assert_eq!(times::<String>(&[]), (Vec::new(), None), "no file");
    }

    #[test]
    fn moments_without_common_numbers_follow_each_other() {
        for names in [
            [["1/000003.jpg", "2/000004.jpg"], ["1/000006.jpg", "2/000006.jpg"]],
            [["1/000006.jpg", "2/000006.jpg"], ["1/000003.jpg", "2/000003.jpg"]],
            [["1/000003.jpg", "2/000003.jpg"], ["1/000003.jpg", "2/000003.jpg"]],
            [["1/a.jpg", "2/a.jpg"], ["1/b.jpg", "2/b.jpg"]],
            // The numbers are those of milliseconds.
            [
                ["a (1)_0001_08-50.592.jpg", "b_0001_08-50.592.jpg"],
                ["a (1)_0002_08-50.612.jpg", "b_0002_08-50.612.jpg"],
            ],
        ] {
            let (found, note) = times(&[&moments(&names)]);
            assert_eq!(found, [[0.0, 1.0 / 30.0]], "{names:?}: one frame after the other");
            assert!(note.is_some_and(|note| note.contains("follow each other")), "{names:?}: the note says so");
        }
    }
}
