//! The edits of a capture, and their text.
//!
//! In: a text in RON, one edit a line. Out: an [`EditList`] whose numbers are valid; or an error with line, column and
//! remedy.

use super::error::EditListError;
use ron::error::SpannedError;
use ron::extensions::Extensions;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

/// Largest size of the text of a list, bytes: some ten thousand edits.
pub(crate) const MOST_BYTES: usize = 1 << 20;

/// The form of a list, for errors of its syntax.
const FORM: &str = "a list of edits is [ and ], and between them lines such as \
                    remove_box(min: (-1, -1, 0), max: (1, 1, 2)),";

/// Edits of a capture, in their order. Default: none.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct EditList {
    /// The edits.
    pub edits: Vec<Edit>,
}

/// One edit: which Gaussians are removed. Places and lengths are in capture units, capture space; `times` are the first
/// and the last timestamp of a stretch of time, the whole time interval if `None`. The [module](super) has the rule of
/// regions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Edit {
    /// Removes what is outside a box.
    KeepBox {
        /// Smallest corner.
        min: [f32; 3],
        /// Largest corner.
        max: [f32; 3],
        /// The stretch of time.
        #[serde(skip_serializing_if = "Option::is_none")]
        times: Option<[f32; 2]>,
    },
    /// Removes what is inside a box.
    RemoveBox {
        /// Smallest corner.
        min: [f32; 3],
        /// Largest corner.
        max: [f32; 3],
        /// The stretch of time.
        #[serde(skip_serializing_if = "Option::is_none")]
        times: Option<[f32; 2]>,
    },
    /// Removes what is outside a sphere.
    KeepSphere {
        /// Center.
        center: [f32; 3],
        /// Radius.
        radius: f32,
        /// The stretch of time.
        #[serde(skip_serializing_if = "Option::is_none")]
        times: Option<[f32; 2]>,
    },
    /// Removes what is inside a sphere.
    RemoveSphere {
        /// Center.
        center: [f32; 3],
        /// Radius.
        radius: f32,
        /// The stretch of time.
        #[serde(skip_serializing_if = "Option::is_none")]
        times: Option<[f32; 2]>,
    },
    /// Removes fog: Gaussians that are faint and large.
    RemoveFaintLarge {
        /// Peak opacity below which a Gaussian is faint, above 0.
        opacity_below: f32,
        /// Largest standard deviation above which it is large, capture units.
        scale_above: f32,
    },
    /// Removes floaters: Gaussians that few training cameras see, close before one of them.
    RemoveFloaters {
        /// Number of cameras, at least 1; a floater is seen by fewer.
        cameras_below: u32,
        /// Distance from the nearest camera below which a Gaussian is close, capture units.
        distance_below: f32,
    },
}

impl EditList {
    /// Parses the text of a list.
    ///
    /// # Errors
    /// A text of more than 1 MiB; the first fault of the text, an edit that does not exist, numbers that an edit cannot
    /// have.
    pub fn parse(text: &[u8]) -> Result<Self, EditListError> {
        if text.len() > MOST_BYTES {
            return Err(EditListError::TooLong { most: MOST_BYTES });
        }
        let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
        let edits: Vec<Checked> = options.from_bytes(text).map_err(of_text)?;
        Ok(Self { edits: edits.into_iter().map(|Checked(edit)| edit).collect() })
    }

    /// Returns whether an edit asks what the training cameras see.
    pub fn needs_cameras(&self) -> bool {
        self.edits.iter().any(Edit::needs_cameras)
    }
}

/// Returns the error of a text. Only the faults that have no remedy of their own get the form of a list.
fn of_text(SpannedError { code, span }: SpannedError) -> EditListError {
    let reason = match code {
        ron::Error::Message(reason) => reason,
        ron::Error::NoSuchEnumVariant { .. } | ron::Error::NoSuchStructField { .. } => code.to_string(),
        _ => format!("{code}: {FORM}"),
    };
    // A span over several lines begins before the space in front of the fault.
    let at = if span.start.line == span.end.line { span.start } else { span.end };
    EditListError::Text { line: at.line, column: at.col, reason }
}

impl Edit {
    /// Returns its name in the text of a list.
    pub fn name(&self) -> &'static str {
        match self {
            Self::KeepBox { .. } => "keep_box",
            Self::RemoveBox { .. } => "remove_box",
            Self::KeepSphere { .. } => "keep_sphere",
            Self::RemoveSphere { .. } => "remove_sphere",
            Self::RemoveFaintLarge { .. } => "remove_faint_large",
            Self::RemoveFloaters { .. } => "remove_floaters",
        }
    }

    /// Returns whether it asks what the training cameras see.
    pub fn needs_cameras(&self) -> bool {
        matches!(self, Self::RemoveFloaters { .. })
    }

    /// Checks its numbers.
    ///
    /// # Errors
    /// What they must be.
    pub fn check(&self) -> Result<(), &'static str> {
        match *self {
            Self::KeepBox { min, max, times } | Self::RemoveBox { min, max, times } => {
                // A comparison with NaN is false.
                let is_box = min.iter().zip(&max).all(|(min, max)| min < max && (max - min).is_finite());
                require(is_box, "a box needs finite numbers, each of min below that of max")?;
                check_times(times)
            }
            Self::KeepSphere { center, radius, times } | Self::RemoveSphere { center, radius, times } => {
                let is_sphere = center.iter().all(|value| value.is_finite()) && is_positive(radius);
                require(is_sphere, "a sphere needs a finite center and a radius above 0")?;
                check_times(times)
            }
            Self::RemoveFaintLarge { opacity_below, scale_above } => {
                require(is_positive(opacity_below), "opacity_below must be above 0, and finite")?;
                require(scale_above.is_finite() && scale_above >= 0.0, "scale_above must be 0 or above, and finite")
            }
            Self::RemoveFloaters { cameras_below, distance_below } => {
                require(cameras_below > 0, "cameras_below must be 1 or above")?;
                require(is_positive(distance_below), "distance_below must be above 0, and finite")
            }
        }
    }
}

fn check_times(times: Option<[f32; 2]>) -> Result<(), &'static str> {
    let is_stretch = times.is_none_or(|[from, to]| from <= to && from.is_finite() && to.is_finite());
    require(is_stretch, "times are two finite timestamps, the first not after the second")
}

fn is_positive(value: f32) -> bool {
    value.is_finite() && value > 0.0
}

fn require(is_met: bool, reason: &'static str) -> Result<(), &'static str> {
    if is_met { Ok(()) } else { Err(reason) }
}

/// An edit whose numbers are checked where its text ends, so that an error has the line of the edit.
struct Checked(Edit);

impl<'de> Deserialize<'de> for Checked {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let edit = Edit::deserialize(deserializer)?;
        edit.check().map_err(|reason| D::Error::custom(format!("{}: {reason}", edit.name())))?;
        Ok(Self(edit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        EditList::parse(text.as_bytes()).expect_err("the text is wrong").to_string()
    }

    #[test]
    fn every_edit_is_read_with_and_without_times() {
        let text = "[
            keep_box(min: (-1, -2, 0), max: (1, 2, 3.5)), // what is on the stage
            remove_box(min: (0, 0, 0), max: (1, 1, 1), times: (0.25, 0.5)),
            keep_sphere(center: (0, 0, 1), radius: 2),
            remove_sphere(center: (0, 0, 1), radius: 0.5, times: (0, 0)),
            remove_faint_large(opacity_below: 0.1, scale_above: 0.5),
            remove_floaters(cameras_below: 3, distance_below: 0.4),
        ]";
        let list = EditList::parse(text.as_bytes()).expect("the text is a list");
        let expected = [
            Edit::KeepBox { min: [-1.0, -2.0, 0.0], max: [1.0, 2.0, 3.5], times: None },
            Edit::RemoveBox { min: [0.0; 3], max: [1.0; 3], times: Some([0.25, 0.5]) },
            Edit::KeepSphere { center: [0.0, 0.0, 1.0], radius: 2.0, times: None },
            Edit::RemoveSphere { center: [0.0, 0.0, 1.0], radius: 0.5, times: Some([0.0; 2]) },
            Edit::RemoveFaintLarge { opacity_below: 0.1, scale_above: 0.5 },
            Edit::RemoveFloaters { cameras_below: 3, distance_below: 0.4 },
        ];
        assert_eq!(list.edits, expected, "the edits in their order");
        for edit in expected {
            assert!(text.contains(edit.name()), "{} is its name in the text", edit.name());
        }
        assert!(list.needs_cameras(), "floaters are found by cameras");
        let again = ron::to_string(&list).expect("a list is a text");
        assert_eq!(EditList::parse(again.as_bytes()), Ok(list), "a list that is written is read again: {again}");
        let none = EditList::parse(b" [] ").expect("a list without edits");
        assert!(none.edits.is_empty() && !none.needs_cameras(), "no edit is left when all are undone");
    }

    #[test]
    fn errors_have_line_column_and_remedy() {
        for (text, place, words) in [
            ("", "line 1, column 1: ", "a list of edits is ["),
            ("[\n  keep_box(min: (0, 0, 0)),\n]", "line 2, ", "max"),
            ("[\n\n  crop_box(min: (0, 0, 0), max: (1, 1, 1)),\n]", "line 3, ", "expected one of `keep_box`"),
            ("[\n  keep_box(min: (0, 0, 0), max: (1, 1, 1), time: (0, 1)),\n]", "line 2, ", "expected one of `min`"),
            ("[\n  keep_box(min: (0, 0), max: (1, 1, 1)),\n]", "line 2, ", "remove_box(min: "),
            ("[\n  remove_box(min: (0, 0, 2), max: (1, 1, 1)),\n]", "line 2, ", "min below that of max"),
            ("[\n  remove_box(min: (0, 0, 0), max: (1, 1, inf)),\n]", "line 2, ", "finite"),
            ("[\n  remove_box(min: (0, 0, 0), max: (1, 1, NaN)),\n]", "line 2, ", "finite"),
            ("[\n  keep_sphere(center: (0, 0, 0), radius: 0),\n]", "line 2, ", "a radius above 0"),
            ("[\n  keep_sphere(center: (0, 0, 0), radius: 1, times: (2, 1)),\n]", "line 2, ", "not after the second"),
            ("[\n  remove_faint_large(opacity_below: 0, scale_above: 1),\n]", "line 2, ", "opacity_below must"),
            ("[\n  remove_faint_large(opacity_below: 0.1, scale_above: -1),\n]", "line 2, ", "scale_above must"),
            ("[\n  remove_floaters(cameras_below: 0, distance_below: 1),\n]", "line 2, ", "cameras_below must"),
            ("[\n  remove_floaters(cameras_below: 2, distance_below: 0),\n]", "line 2, ", "distance_below must"),
        ] {
            let message = message(text);
            assert!(message.starts_with(place) && message.contains(words), "{text:?}: {place}{words}: {message}");
        }
        assert!(EditList::parse(&[b'[', 0xff]).is_err(), "bytes that are no text are an error");
        let long = EditList::parse(&vec![b' '; MOST_BYTES + 1]);
        assert_eq!(long, Err(EditListError::TooLong { most: MOST_BYTES }), "the size is limited");
    }
}
