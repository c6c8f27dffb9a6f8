//! The distribution of a measure as a drawing.
//!
//! In: the values of all bakes, and the usual values. Out: an SVG with one dot for each bake on an axis; outliers are
//! marked. A dot is a link to the row of its bake.

use super::measure::Measure;
use super::outliers::Usual;
use crate::offline::report::html::escape;

/// Width of the drawing. All lengths and positions are in units of the drawing.
const WIDTH: f64 = 300.0;
/// Height of the drawing.
const HEIGHT: f64 = 44.0;
/// Room on the left and on the right of the axis.
const MARGIN: f64 = 8.0;
/// Vertical position of the axis.
const MIDDLE: f64 = 20.0;
/// Number of rows on which dots lie, so that equal values do not hide each other.
const ROWS: usize = 5;

/// A bake in a drawing.
pub(crate) struct Dot<'a> {
    /// Number of its row.
    pub row: usize,
    /// Name of its package.
    pub name: &'a str,
    /// Value of the measure.
    pub value: f64,
}

/// Draws the values of a measure. Returns an empty text without values.
pub(crate) fn strip(measure: &Measure, usual: Option<&Usual>, dots: &[Dot]) -> String {
    let scaled = |value: f64| if measure.is_factor { value.ln() } else { value };
    let values = || dots.iter().map(|dot| dot.value);
    let [low, high] = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
    if low.partial_cmp(&high).is_none_or(|order| order.is_gt()) {
        return String::new();
    }
    let size = scaled(high) - scaled(low);
    let place = |value: f64| {
        let part = if size > 0.0 { (scaled(value) - scaled(low)) / size } else { 0.5 };
        MARGIN + part.clamp(0.0, 1.0) * (WIDTH - 2.0 * MARGIN)
    };
    let mut svg =
        format!("<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">", escape(measure.head));
    if let Some(usual) = usual {
        let [from, to, median] = [usual.low, usual.high, usual.median].map(place);
        svg += &format!("<rect class=\"usual\" x=\"{from:.1}\" y=\"4\" width=\"{:.1}\" height=\"32\"/>", to - from);
        svg += &format!("<line class=\"median\" x1=\"{median:.1}\" x2=\"{median:.1}\" y1=\"4\" y2=\"36\"/>");
    }
    for (index, dot) in dots.iter().enumerate() {
        let class = if usual.is_some_and(|usual| !usual.has(dot.value)) { "dot far" } else { "dot" };
        let y = MIDDLE + ((index % ROWS) as f64 - (ROWS / 2) as f64) * 5.0;
        svg += &format!(
            "<a href=\"#bake-{}\"><circle class=\"{class}\" cx=\"{:.1}\" cy=\"{y}\" r=\"3\"><title>{}: {}</title></circle></a>",
            dot.row,
            place(dot.value),
            escape(dot.name),
            measure.shown(dot.value),
        );
    }
    svg += "</svg>";
    let ends = [low, high].map(|value| measure.shown(value));
    svg + &format!("<p class=\"ends\"><span>{}</span><span>{}</span></p>", ends[0], ends[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::report::fleet::measure::MEASURES;

    #[test]
    fn drawings_of_any_values_have_numbers_alone() {
        for values in [vec![], vec![5.0], vec![5.0; 8], vec![1.0, 2.0, 1e300, 1e-300, 3.0]] {
            for measure in &MEASURES {
                let dots = values.iter().map(|&value| Dot { row: 0, name: "a<b", value }).collect::<Vec<_>>();
                let svg = strip(measure, Usual::of(measure, &values).as_ref(), &dots);
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{}: {values:?}: {svg}", measure.id);
                assert!(!svg.contains("a<b"), "names are escaped: {svg}");
            }
        }
    }
}
