//! Changes to texts that consist of lines of words, as COLMAP writes them.
//!
//! In: a text, that of another seed. Out: a text with words replaced by numbers and odd values, and words or lines
//! removed, repeated, moved or taken from the other text.

use super::bytes::MOST;
use super::{change_list, numbers};
use crate::support::random::Random;
use std::iter::repeat_n;

/// Most lines that are inserted at once.
const LINES: usize = 3000;

/// Makes one to four changes.
pub fn change(text: &str, other: &str, random: &mut Random) -> String {
    let (mut changed, other) = (lines(text), lines(other));
    for _ in 0..=random.below(4) {
        change_once(&mut changed, &other, random);
    }
    let mut text: String = changed.iter().map(|words| words.join(" ") + "\n").collect();
    text.truncate(text.floor_char_boundary(MOST));
    text
}

fn change_once(lines: &mut Vec<Vec<String>>, others: &[Vec<String>], random: &mut Random) {
    let at = random.below(lines.len());
    let Some(line) = lines.get_mut(at).filter(|words| !words.is_empty()) else {
        return change_list(lines, others, random);
    };
    let word = random.below(line.len());
    match random.below(10) {
        0..=3 => line[word] = numbers::text(random),
        4 | 5 => line[word] = value(random),
        6 => {
            let other: &Vec<String> = random.pick(others);
            change_list(line, other, random);
        }
        7 => {
            let copies = repeat_n(lines[at].clone(), *random.pick(&[1, 30, LINES]));
            lines.splice(at..at, copies);
        }
        _ => change_list(lines, others, random),
    }
}

/// Returns a word that is not a number.
fn value(random: &mut Random) -> String {
    const VALUES: [&str; 16] = [
        "",
        "#",
        ".",
        "..",
        "/",
        "../../a.png",
        "/dev/null",
        "./a.png",
        "cam0/0001.png",
        "a\u{1b}[2Jb",
        "a\0b",
        "\u{1f4a5}.png",
        "FULL_OPENCV",
        "OPENCV_FISHEYE",
        "SIMPLE_PINHOLE",
        "FOV",
    ];
    if random.one_in(12) {
        "a".repeat(*random.pick(&[255, 256, 4097, 1 << 17]))
    } else {
        (*random.pick(&VALUES)).to_owned()
    }
}

fn lines(text: &str) -> Vec<Vec<String>> {
    text.lines().map(|line| line.split(' ').map(str::to_owned).collect()).collect()
}
