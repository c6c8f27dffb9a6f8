//! Plots as inline SVG.
//!
//! In: numbers with names. Out: SVG without a style of its own: the style of the page applies to the classes `s0`,
//! `s1`, … of the series, `axis`, `grid` and `text`.

use super::html::escape;
use std::fmt::Write;

/// Width of a drawing. All lengths and positions are in units of the drawing.
const WIDTH: f64 = 560.0;
/// Height of a plot.
const HEIGHT: f64 = 300.0;
/// Room around the plot area: left, top, right, bottom.
const MARGIN: [f64; 4] = [58.0, 12.0, 14.0, 44.0];
/// Height of a bar with its gap.
const BAR: f64 = 26.0;
/// Room for the name of a bar.
const BAR_NAME: f64 = 150.0;
/// Room for the value of a bar.
const BAR_VALUE: f64 = 120.0;

/// A plot of lines.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chart {
    /// What the horizontal axis shows.
    pub x: Axis,
    /// What the vertical axis shows.
    pub y: Axis,
    /// The lines, drawn in order.
    pub series: Vec<Series>,
}

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    /// Its name with the unit.
    pub label: String,
    /// Whether it is logarithmic; only values above zero are drawn then.
    pub log: bool,
    /// The range shown; `None` shows that of the values.
    pub range: Option<[f64; 2]>,
}

/// One line.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Its points; those that are not finite interrupt it.
    pub points: Vec<[f64; 2]>,
    /// Whether a dot is drawn at every point.
    pub dots: bool,
}

impl Axis {
    /// Returns a linear axis over the range of the values.
    pub(crate) fn new(label: &str) -> Self {
        Self { label: label.to_owned(), log: false, range: None }
    }

    /// Returns the range of these values (of their logarithms, for a logarithmic axis), never empty.
    fn limits(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        let [low, high] = match self.range {
            Some(range) => range.map(|v| self.place(v)),
            None => values
                .map(|v| self.place(v))
                .filter(|v| v.is_finite())
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]),
        };
        match (low.is_finite() && high.is_finite(), high - low) {
            (false, _) => [0.0, 1.0],
            (true, length) if length <= 1e-12 * high.abs().max(1e-12) => [low - 0.5, high + 0.5],
            (true, length) if self.range.is_none() && !self.log => [low - 0.04 * length, high + 0.04 * length],
            _ => [low, high],
        }
    }

    fn place(&self, value: f64) -> f64 {
        if self.log { value.log10() } else { value }
    }

    /// Returns the positions of the ticks and their labels.
    fn ticks(&self, [low, high]: [f64; 2]) -> Vec<(f64, String)> {
        if self.log && high - low >= 1.0 {
            let step = ((high - low) / 8.0).ceil().max(1.0) as i32;
            let first = low.ceil() as i32;
            let whole = (0i32..).map(|i| first + i * step).take_while(|&p| f64::from(p) <= high + 1e-9);
            return whole.map(|power| (f64::from(power), format!("1e{power}"))).collect();
        }
        let step = nice_step((high - low) / 5.0);
        let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
        let first = (low / step).ceil();
        let all = (0i32..).map(|i| (first + f64::from(i)) * step).take_while(|&v| v <= high + step * 1e-9);
        let said = |v: f64| if self.log { format!("{:.2e}", 10f64.powf(v)) } else { format!("{v:.decimals$}") };
        all.map(|v| (v, said(v))).collect()
    }
}

/// Returns the smallest step at or above `least` that is 1, 2 or 5 times a power of ten.
fn nice_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|s| *s >= least * (1.0 - 1e-9)).unwrap_or(least)
}

impl Chart {
    /// Returns the plot as SVG text.
    pub(crate) fn svg(&self) -> String {
        let values = |axis: usize| self.series.iter().flat_map(move |s| s.points.iter().map(move |p| p[axis]));
        let (xs, ys) = (self.x.limits(values(0)), self.y.limits(values(1)));
        let [left, top, right, bottom] = [MARGIN[0], MARGIN[1], WIDTH - MARGIN[2], HEIGHT - MARGIN[3]];
        let at_x = |place: f64| left + (place - xs[0]) / (xs[1] - xs[0]) * (right - left);
        let at_y = |place: f64| bottom - (place - ys[0]) / (ys[1] - ys[0]) * (bottom - top);
        let mut svg = format!("<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\">");
        for (place, said) in self.x.ticks(xs) {
            let x = at_x(place);
            svg += &line("grid", [x, top, x, bottom]);
            svg += &text([x, bottom + 16.0], "middle", &said);
        }
        for (place, said) in self.y.ticks(ys) {
            let y = at_y(place);
            svg += &line("grid", [left, y, right, y]);
            svg += &text([left - 6.0, y + 4.0], "end", &said);
        }
        svg += &line("axis", [left, bottom, right, bottom]);
        svg += &line("axis", [left, top, left, bottom]);
        svg += &text([(left + right) / 2.0, HEIGHT - 8.0], "middle", &self.x.label);
        let middle = (top + bottom) / 2.0;
        let label = escape(&self.y.label);
        let turned = format!("transform=\"rotate(-90 14 {middle:.1})\"");
        svg +=
            &format!("<text class=\"text\" x=\"14\" y=\"{middle:.1}\" text-anchor=\"middle\" {turned}>{label}</text>");
        for (index, series) in self.series.iter().enumerate() {
            let placed = series.points.iter().map(|&[x, y]| {
                let (x, y) = (self.x.place(x), self.y.place(y));
                (x.is_finite() && y.is_finite()).then(|| [at_x(x), at_y(y)])
            });
            svg += &series.svg(index, placed.collect::<Vec<_>>().as_slice());
        }
        svg + "</svg>"
    }

    /// Returns the legend as HTML: the names of the lines in their colors.
    pub(crate) fn legend(&self) -> String {
        let entry = |(index, series): (usize, &Series)| {
            format!("<span class=\"key\"><i class=\"s{index}\"></i>{}</span>", escape(&series.name))
        };
        self.series.iter().enumerate().map(entry).collect()
    }
}

impl Series {
    fn svg(&self, index: usize, placed: &[Option<[f64; 2]>]) -> String {
        let mut path = String::new();
        let mut drawing = false;
        for point in placed {
            if let Some([x, y]) = point {
                let _ = write!(path, "{}{x:.1} {y:.1}", if drawing { "L" } else { "M" });
            }
            drawing = point.is_some();
        }
        let mut svg = format!("<path class=\"line s{index}\" d=\"{path}\"/>");
        for [x, y] in placed.iter().flatten().filter(|_| self.dots) {
            let _ = write!(svg, "<circle class=\"dot s{index}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/>");
        }
        svg
    }
}

/// Returns horizontal bars as SVG text. Each row has a name, a value and the label beside the bar.
pub(crate) fn bars(rows: &[(String, f64, String)]) -> String {
    let height = BAR * rows.len().max(1) as f64;
    let most = rows.iter().map(|row| row.1).fold(f64::MIN_POSITIVE, f64::max);
    let room = WIDTH - BAR_NAME - BAR_VALUE;
    let mut svg = format!("<svg viewBox=\"0 0 {WIDTH} {height}\" role=\"img\">");
    for (index, (name, value, said)) in rows.iter().enumerate() {
        let y = BAR * index as f64;
        let length = (value / most * room).max(1.0);
        svg += &text([BAR_NAME - 8.0, y + 17.0], "end", name);
        let _ = write!(
            svg,
            "<rect class=\"bar s0\" x=\"{BAR_NAME}\" y=\"{:.1}\" width=\"{length:.1}\" height=\"18\"/>",
            y + 4.0
        );
        svg += &text([BAR_NAME + length + 8.0, y + 17.0], "start", said);
    }
    svg + "</svg>"
}

fn line(class: &str, [x1, y1, x2, y2]: [f64; 4]) -> String {
    format!("<line class=\"{class}\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/>")
}

fn text([x, y]: [f64; 2], anchor: &str, said: &str) -> String {
    let said = escape(said);
    format!("<text class=\"text\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{said}</text>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers() {
        let axis = Axis::new("x");
        let said: Vec<_> = axis.ticks([0.0, 1.0]).into_iter().map(|(_, said)| said).collect();
        assert_eq!(said, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"], "fifths of one");
        let log = Axis { log: true, ..Axis::new("x") };
        let said: Vec<_> = log.ticks([-4.2, 0.3]).into_iter().map(|(_, said)| said).collect();
        assert_eq!(said, ["1e-4", "1e-3", "1e-2", "1e-1", "1e0"], "powers of ten");
        assert_eq!(nice_step(0.7), 1.0, "rounded up");
        assert_eq!(nice_step(30.0), 50.0, "of any size");
    }

    #[test]
    fn every_input_gives_finite_places() {
        let awkward = [[0.0, 1.0], [f64::NAN, 2.0], [1.0, f64::INFINITY], [1.0, 1.0]];
        for points in [vec![], vec![[3.0, 3.0]], awkward.to_vec()] {
            for log in [false, true] {
                let axis = || Axis { log, ..Axis::new("a < b") };
                let series = Series { name: "one".into(), points: points.clone(), dots: true };
                let svg = Chart { x: axis(), y: axis(), series: vec![series] }.svg();
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{points:?}: {svg}");
                assert!(svg.contains("a &lt; b"), "labels are escaped: {svg}");
            }
        }
        assert!(bars(&[]).ends_with("</svg>"), "no bars at all");
    }
}
