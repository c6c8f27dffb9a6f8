//! Values of options: how they are spelled and which are accepted.
//!
//! In: the text after an option. Out: the value, or as an error the reason, which clap shows with the option's name.

use crate::offline::dataset::MAX_SIDE;
use crate::offline::filter::KeyFrames;
use crate::offline::segments::LayerShares;
use crate::scene::ChunkTable;
use clap::builder::{PossibleValuesParser, RangedU64ValueParser, TypedValueParser};
use glam::UVec2;

/// The largest weight, factor or number of decibels: beyond any use, and far from the limits of single precision.
const LARGEST: f64 = 1e6;

fn numbers<const N: usize>(text: &str) -> Option<[f32; N]> {
    let values: Vec<f32> = text.split(',').map(|v| v.trim().parse().ok()).collect::<Option<_>>()?;
    <[f32; N]>::try_from(values).ok().filter(|values| values.iter().all(|v| v.is_finite()))
}

/// Parses `R,G,B`.
pub(crate) fn color(text: &str) -> Result<[f32; 3], String> {
    numbers(text).ok_or_else(|| "expected three numbers, such as 0,0.5,1".to_owned())
}

/// Parses `X,Y,Z`.
pub(crate) fn point(text: &str) -> Result<[f32; 3], String> {
    numbers(text).ok_or_else(|| "expected three numbers, such as 0.5,-1,0".to_owned())
}

/// Parses `X0,Y0,Z0,X1,Y1,Z1`, the corners of a box: on each axis the first is below the second.
pub(crate) fn corners(text: &str) -> Result<[[f32; 3]; 2], String> {
    let corners = numbers::<6>(text).map(|[x0, y0, z0, x1, y1, z1]| [[x0, y0, z0], [x1, y1, z1]]);
    let corners = corners.filter(|[low, high]| low.iter().zip(high).all(|(low, high)| low < high));
    corners.ok_or_else(|| "expected two corners, the lower one first, such as -1,-1,0,1,1,2".to_owned())
}

/// Parses `T0,T1` with T0 before T1, in double precision: seconds since 1970 lose their fractions in single precision.
pub(crate) fn interval(text: &str) -> Result<[f64; 2], String> {
    let time = |text: &str| text.trim().parse::<f64>().ok().filter(|time| time.is_finite());
    let times = text.split_once(',').and_then(|(first, last)| time(first).zip(time(last)));
    let times = times.filter(|(first, last)| first < last).map(|(first, last)| [first, last]);
    times.ok_or_else(|| "expected two numbers in order, such as 0,10".to_owned())
}

/// Parses a finite number.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    numbers::<1>(text).map(|[value]| value).ok_or_else(|| "expected a finite number".to_owned())
}

/// Parses a finite number above zero.
pub(crate) fn positive(text: &str) -> Result<f32, String> {
    number(text).ok().filter(|v| *v > 0.0).ok_or_else(|| "expected a number above zero".to_owned())
}

/// Parses a finite number of seconds, not below zero.
pub(crate) fn seconds(text: &str) -> Result<f32, String> {
    number(text).ok().filter(|v| *v >= 0.0).ok_or_else(|| "expected a number of seconds, zero or above".to_owned())
}

/// Parses a share, 0 to 1.
pub(crate) fn share(text: &str) -> Result<f64, String> {
    let share = text.trim().parse::<f64>().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

/// Parses the shares of layers, such as `25,25,50`.
pub(crate) fn layers(text: &str) -> Result<LayerShares, String> {
    let shares: Option<Vec<u32>> = text.split(',').map(|share| share.trim().parse().ok()).collect();
    shares.and_then(LayerShares::new).ok_or_else(|| {
        let most = ChunkTable::MOST_LAYERS;
        format!("expected whole percentages, 100 in all, such as 25,25,50, at most {most} of them")
    })
}

/// Parses an opacity that something can have: a number above 0 and below 1.
pub(crate) fn opacity(text: &str) -> Result<f32, String> {
    let opacity = number(text).ok().filter(|opacity| *opacity > 0.0 && *opacity < 1.0);
    opacity.ok_or_else(|| "expected a number above 0 and below 1".to_owned())
}

/// Parses a number from 0 to [`LARGEST`], in double precision.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|value| (0.0..=LARGEST).contains(value));
    value.ok_or_else(|| format!("expected a number from 0 to {LARGEST}"))
}

/// Returns a parser for a number from 0 to `most`.
pub(crate) fn up_to(most: f32) -> impl TypedValueParser<Value = f32> {
    move |text: &str| {
        let value = number(text).ok().filter(|value| (0.0..=most).contains(value));
        value.ok_or_else(|| format!("expected a number from 0 to {most}"))
    }
}

/// Parses 0, or a number above it that is a normal number of single precision.
pub(crate) fn step(text: &str) -> Result<f32, String> {
    let value = text.trim().parse::<f64>().ok().filter(|value| *value >= 0.0);
    let usable = value.map(|value| (value, value as f32)).filter(|(value, step)| *value == 0.0 || step.is_normal());
    usable
        .map(|(_, step)| step)
        .ok_or_else(|| format!("expected 0, or a number from {:e} to {:e}", f32::MIN_POSITIVE, f32::MAX))
}

/// Parses `WxH` in pixels.
pub(crate) fn size(text: &str) -> Result<UVec2, String> {
    let side = |text: &str| text.parse::<u32>().ok().filter(|side| (1..=MAX_SIDE).contains(side));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some(UVec2::new(side(width)?, side(height)?)))
        .ok_or_else(|| format!("expected WIDTHxHEIGHT, such as 1352x1014, at most {MAX_SIDE} each"))
}

/// Returns a parser for whole numbers from 1 to `most`.
pub(crate) fn count(most: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=most)
}

/// Returns a parser for a whole number from 0 to `most`.
pub(crate) fn count_or_none(most: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(0..=most)
}

/// Returns a parser for `on` or `off`.
pub(crate) fn switch() -> impl TypedValueParser<Value = bool> {
    one_of(&SWITCH)
}

const SWITCH: [(&str, bool); 2] = [("on", true), ("off", false)];

/// Returns a parser for one of a few names, each of which stands for a value.
pub(crate) fn one_of<T>(choices: &'static [(&'static str, T)]) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let first = choices[0].1;
    PossibleValuesParser::new(choices.iter().map(|(name, _)| *name))
        .map(move |text| choices.iter().find(|(name, _)| *name == text).map_or(first, |(_, value)| *value))
}

/// Returns the key-frames that `--key-frames K` or `--every FRAMES` specify, of which at most one is given.
pub(crate) fn key_frames(count: Option<u32>, every: Option<usize>) -> KeyFrames {
    every.map(KeyFrames::Every).or(count.map(KeyFrames::Count)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_exact() {
        assert_eq!(color("0, .5,-1"), Ok([0.0, 0.5, -1.0]), "three numbers");
        assert_eq!(size("1352x1014"), Ok(UVec2::new(1352, 1014)), "a size");
        assert_eq!(corners("-1,-2,-3, 1,2,3"), Ok([[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]]), "a box");
        assert_eq!(opacity("0.5"), Ok(0.5), "an opacity");
        assert_eq!(layers("25, 25,50"), Ok(LayerShares::default()), "three layers");
    }

    #[test]
    fn nonsense_is_refused() {
        for text in ["", "1,2", "1,2,3,4", "a,b,c", "nan,0,0", "inf,0,0", "1e99,0,0"] {
            assert!(color(text).is_err(), "{text:?} is no color");
        }
        for text in ["", "400", "0x4", "4x0", "-4x4", "99999x4", "4x4x4"] {
            assert!(size(text).is_err(), "{text:?} is no size");
        }
        for text in ["", "-0.1", "1.1", "nan", "80%"] {
            assert!(share(text).is_err(), "{text:?} is no share");
        }
        for text in ["", "0", "1", "1.5", "-0.5", "nan"] {
            assert!(opacity(text).is_err(), "{text:?} is no opacity that something can have");
        }
        for text in ["", "0,0,0", "1,0,0,0,1,1", "0,0,0,1,1,0", "0,0,0,1,1,nan", "0,0,0,1,1,inf", "0,0,0,1,1,1,1"] {
            assert!(corners(text).is_err(), "{text:?} is no box");
        }
        for text in ["", "50", "0,100", "50,60", "33.3,66.7", "25,25,50,", "-50,150"] {
            assert!(layers(text).is_err(), "{text:?} are no shares of layers");
        }
        assert!(not_negative("-1").is_err() && not_negative("inf").is_err(), "finite and not below zero");
        assert!(not_negative("1e6").is_ok() && not_negative("1e308").is_err(), "at most the largest value");
        assert!(step("-1").is_err() && step("1e308").is_err(), "in single precision and not below zero");
        for text in ["1,1", "1", "1,2,3", "0,inf", "nan,1"] {
            assert!(interval(text).is_err(), "{text:?} is no interval with a length");
        }
        assert_eq!(interval("1700000000, 1700000000.5"), Ok([1_700_000_000.0, 1_700_000_000.5]), "every digit");
        assert!(positive("0").is_err(), "zero is not above zero");
        assert!(seconds("0").is_ok() && seconds("-1").is_err() && seconds("nan").is_err(), "a still has no seconds");
    }
}
