//! The report over many bakes, for programs.
//!
//! In: the results of each bake. Out: the figures of all, with the outliers among them; as JSON and as comma-separated
//! values.

use super::bake::Bake;
use super::measure::{MEASURES, Measure};
use super::outliers::{Outlier, Usual};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// The report over many bakes.
#[derive(Debug, Clone)]
pub(crate) struct FleetReport {
    /// The results of each bake, in the order of the packages.
    pub bakes: Vec<Bake>,
    /// The usual values of each of [`MEASURES`]; `None` where too few are known.
    pub usual: [Option<Usual>; MEASURES.len()],
}

impl FleetReport {
    /// Reads packages and the reports beside them.
    pub(crate) fn read(packages: &[PathBuf]) -> Self {
        Self::of(packages.par_iter().map(|package| Bake::read(package)).collect())
    }

    /// Compares bakes.
    pub(crate) fn of(bakes: Vec<Bake>) -> Self {
        let usual = MEASURES.map(|measure| {
            let values: Vec<f64> = bakes.iter().filter_map(|bake| measure.of(bake)).collect();
            Usual::of(&measure, &values)
        });
        Self { bakes, usual }
    }

    /// Returns what is unusual about a bake.
    pub(crate) fn outliers(&self, bake: &Bake) -> Vec<Outlier> {
        let unusual = |(measure, usual): (Measure, &Option<Usual>)| {
            let (value, usual) = (measure.of(bake)?, (*usual)?);
            (!usual.has(value)).then_some(Outlier { measure, value, usual })
        };
        MEASURES.into_iter().zip(&self.usual).filter_map(unusual).collect()
    }

    /// Returns the bakes that have failed, with their sentences.
    pub(crate) fn failures(&self) -> impl Iterator<Item = (&Bake, &str)> {
        self.bakes.iter().filter_map(|bake| Some((bake, bake.failure.as_deref()?)))
    }

    /// Returns the JSON document.
    pub(crate) fn json(&self) -> Value {
        let usual = |(measure, usual): (&Measure, &Option<Usual>)| {
            let usual = usual.map(|Usual { median, low, high }| json!({ "median": median, "low": low, "high": high }));
            (measure.id.to_owned(), json!(usual))
        };
        json!({
            "bakes": self.bakes.iter().map(|bake| self.bake_json(bake)).collect::<Vec<_>>(),
            "usual": MEASURES.iter().zip(&self.usual).map(usual).collect::<Map<_, _>>(),
            "failures": self.failures().count(),
        })
    }

    fn bake_json(&self, bake: &Bake) -> Value {
        let figures = bake.figures.as_ref();
        let reported = figures.and_then(|figures| figures.reported.as_ref());
        let measures = MEASURES.iter().map(|measure| (measure.id.to_owned(), json!(measure.of(bake))));
        let outliers = self.outliers(bake).into_iter().map(
            |outlier| json!({ "measure": outlier.measure.id, "value": outlier.value, "is_high": outlier.is_high() }),
        );
        json!({
            "package": bake.package.display().to_string(),
            "page": bake.page.as_ref().map(|page| page.display().to_string()),
            "form": figures.map(|figures| figures.form),
            "checkpoint": reported.and_then(|reported| reported.checkpoint.as_ref()),
            "checkpoint_bytes": reported.and_then(|reported| reported.bytes),
            "choices": reported.map(|reported| &reported.choices),
            "measures": measures.collect::<Map<_, _>>(),
            "outliers": outliers.collect::<Vec<_>>(),
            "notes": bake.notes,
            "failure": bake.failure,
        })
    }

    /// Returns a table of comma-separated values, one row for each bake (RFC 4180).
    pub(crate) fn csv(&self) -> String {
        let ids = MEASURES.iter().map(|measure| measure.id);
        let heads = ["package", "form"].into_iter().chain(ids).chain(["outliers", "notes", "failure"]);
        let mut text = row(&heads.map(str::to_owned).collect::<Vec<_>>());
        for bake in &self.bakes {
            let form = bake.figures.as_ref().map_or("", |figures| figures.form);
            let mut cells = vec![bake.package.display().to_string(), form.to_owned()];
            cells.extend(
                MEASURES.iter().map(|measure| measure.of(bake).map_or_else(String::new, |value| measure.shown(value))),
            );
            let outliers: Vec<&str> = self.outliers(bake).iter().map(|outlier| outlier.measure.id).collect();
            cells.push(outliers.join(" "));
            cells.push(bake.notes.join("; "));
            cells.push(bake.failure.clone().unwrap_or_default());
            text += &row(&cells);
        }
        text
    }
}

/// Returns a row, with quotes around cells that need them.
fn row(cells: &[String]) -> String {
    let quoted = |cell: &String| match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.clone(),
    };
    cells.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::report::fleet::bake::Figures;

    fn bake(name: &str, gaussians: usize) -> Bake {
        let figures = Figures { form: "packed", gaussians, bytes: 1000 * gaussians as u64, reported: None };
        Bake { package: name.into(), figures: Some(figures), ..Bake::default() }
    }

    #[test]
    fn the_bake_that_differs_is_marked() {
        let mut bakes: Vec<Bake> = (0..6).map(|index| bake("a.gs4d", 1000 + index)).collect();
        bakes.push(bake("large.gs4d", 9000));
        let report = FleetReport::of(bakes);
        let marked: Vec<_> = report.bakes.iter().map(|bake| report.outliers(bake).len()).collect();
        assert_eq!(marked, [0, 0, 0, 0, 0, 0, 2], "its Gaussians and its size, and nothing of the others");
        let outlier = report.json()["bakes"][6]["outliers"][0].clone();
        assert_eq!((&outlier["measure"], &outlier["is_high"]), (&"gaussians".into(), &true.into()), "by name and side");
    }

    #[test]
    fn cells_with_commas_and_quotes_keep_their_text() {
        let mut damaged = Bake { package: "a,\"b\".gs4d".into(), ..Bake::default() };
        damaged.failure = Some("no luck".to_owned());
        let csv = FleetReport::of(vec![bake("plain.gs4d", 10), damaged]).csv();
        let rows: Vec<&str> = csv.lines().collect();
        assert_eq!(rows.len(), 3, "a head and two rows");
        assert_eq!(rows[1], "plain.gs4d,packed,10,,0.010,1000.0,,,,,,,", "unknown figures are empty");
        assert!(rows[2].starts_with("\"a,\"\"b\"\".gs4d\",,") && rows[2].ends_with(",no luck"), "quoted: {}", rows[2]);
    }
}
