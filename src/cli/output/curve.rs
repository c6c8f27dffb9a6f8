//! The curve of a training run as a table.
//!
//! In: the points of the curve. Out: text.

use super::table::Table;
use crate::offline::train::CurvePoint;

/// Returns the points of the curve as a table; a value that was not measured is "-". If the result is compressed, the
/// last point is that of the package.
pub(crate) fn curve_table(curve: &[CurvePoint], compressed: bool) -> String {
    let mut table = Table::new(&["step", "loss", "training dB", "validation dB"]);
    let number = |value: Option<f64>, digits| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
    for (index, CurvePoint { step, loss, training_psnr, psnr }) in curve.iter().enumerate() {
        let is_package = compressed && index + 1 == curve.len();
        let step = if is_package { "compressed".to_owned() } else { step.to_string() };
        table.row([step, number(*loss, 5), number(*training_psnr, 2), number(*psnr, 3)]);
    }
    table.to_string()
}
