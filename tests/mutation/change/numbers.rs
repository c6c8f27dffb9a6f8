//! Numbers at the ends of their types, where sums and products overflow.
//!
//! In: random numbers. Out: numbers, in memory and as text.

use crate::support::random::Random;

/// Returns a float: not a number, infinite, tiny, as large as possible, small, or any float.
pub fn float(random: &mut Random) -> f32 {
    const ENDS: [f32; 20] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        f32::EPSILON,
        1e-20,
        -1e-20,
        88.7,
        -104.0,
        1e20,
        -1e20,
        3e38,
        -3e38,
        f32::MAX,
        f32::MIN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
    ];
    match random.below(6) {
        0 => f32::from_bits(random.bits() as u32),
        1 => (random.below(4001) as f32 - 2000.0) * 0.01,
        _ => *random.pick(&ENDS),
    }
}

/// Returns a whole number: at a power of two or next to it, as large as possible, or any number.
pub fn whole(random: &mut Random) -> u64 {
    match random.below(6) {
        0 => random.bits(),
        1 => random.below(300) as u64,
        _ => {
            let power = 1u64 << random.below(64);
            *random.pick(&[0, 1, u64::MAX, power - 1, power, power + 1, i64::MAX as u64, u64::from(u32::MAX)])
        }
    }
}

/// Returns a number as text, some of which no type can hold.
pub fn text(random: &mut Random) -> String {
    const ODD: [&str; 20] = [
        "-0",
        "-1",
        "1.5",
        "0.0",
        "NaN",
        "-NaN",
        "inf",
        "-inf",
        "1e999",
        "-1e999",
        "1e-400",
        "1e39",
        "3.4e38",
        "-3.4e38",
        "0x10",
        "007",
        "1_000",
        "18446744073709551616",
        "-9223372036854775809",
        "4294967296",
    ];
    match random.below(4) {
        0 => whole(random).to_string(),
        1 => format!("{:e}", float(random)),
        2 => format!("{:?}", float(random)),
        _ => (*random.pick(&ODD)).to_owned(),
    }
}
