//! `gs4d report PACKAGE...`: the results of many bakes on one page.
//!
//! In: packages, or folders with packages, and the reports that `gs4d bake` has left beside them. Out: a table of their
//! figures with the outliers and the failures, and the same as an HTML page and as comma-separated values.

use crate::cli::output::failure::Failure;
use crate::cli::output::report::Report;
use crate::cli::output::table::Table;
use crate::offline::report::fleet::{Bake, FleetReport, MEASURES, Measure, find_packages};
use crate::offline::store::outputs::Files;
use crate::offline::work::write_beside;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Compare the results of many bakes: sizes, PSNR, Gaussians, times, with outliers and failures marked.
///
/// The figures are those of the packages' headers, whose checksums are verified, and of the NAME.report.json that gs4d
/// bake writes beside NAME.gs4d. The exit code is 2 if a package is missing, damaged or unfinished; everything is
/// written nevertheless.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d report baked/*.gs4d
  gs4d report baked -o baked/all.html
  gs4d report baked --csv baked.csv --json

A figure is an outlier if it lies more than 3.5 robust standard deviations from the median of at least five bakes; sizes, counts and times are
compared by factors. The page needs no network: links lead from it to the packages and to their own reports.")]
pub(crate) struct Fleet {
    /// Packages (.gs4d), or folders: all packages in them and in their folders, but not the NAME.trained.gs4d that
    /// bakes keep.
    #[arg(value_name = "PACKAGE", required = true)]
    packages: Vec<PathBuf>,
    /// Write the report as an HTML page that can be sorted and searched.
    #[arg(short, long, value_name = "PAGE.html")]
    out: Option<PathBuf>,
    /// Write the figures as comma-separated values, too.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

impl Fleet {
    /// Reads and compares the packages.
    ///
    /// # Errors
    /// Folders without packages, files that cannot be written. If a bake has failed, the result is a report with a
    /// failure.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let packages = find_packages(&self.packages)?;
        let mut files = Files::default().reads(&packages);
        if let Some(out) = &self.out {
            files = files.writes(out, "html");
        }
        if let Some(csv) = &self.csv {
            files = files.writes(csv, "csv");
        }
        files.check()?;
        let fleet = FleetReport::read(&packages);
        let write = |path: &Path, text: String| write_beside(path, |file| file.write_all(text.as_bytes()));
        if let Some(out) = &self.out {
            write(out, fleet.html(out))?;
        }
        if let Some(csv) = &self.csv {
            write(csv, fleet.csv())?;
        }
        let failed = fleet.failures().count();
        let failure = fleet.failures().next().map(|(bake, failure)| {
            let first = format!("{}: {failure}", name(bake));
            Failure::new(if failed == 1 {
                first
            } else {
                format!("{failed} of {} bakes have failed; {first}", packages.len())
            })
        });
        let mut json = fleet.json();
        let shown = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
        json["out"] = shown(&self.out).into();
        json["csv"] = shown(&self.csv).into();
        json["error"] = failure.as_ref().map(Failure::message).into();
        Ok(Report { failure, ..Report::new(json, text(&fleet)) })
    }
}

fn name(bake: &Bake) -> String {
    bake.package.display().to_string()
}

/// Returns the table, and lines about outliers, notes and failures.
fn text(fleet: &FleetReport) -> String {
    let heads: Vec<&str> = ["package", "form"].into_iter().chain(MEASURES.iter().map(|measure| measure.head)).collect();
    let mut table = Table::new(&heads);
    for bake in fleet.bakes.iter().filter(|bake| bake.figures.is_some()) {
        let form = bake.figures.as_ref().map_or("", |figures| figures.form).to_owned();
        let value = |measure: &Measure| measure.of(bake).map_or("-".to_owned(), |v| measure.shown(v));
        table.row([name(bake), form].into_iter().chain(MEASURES.iter().map(value)));
    }
    let outliers = fleet.bakes.iter().flat_map(|bake| {
        let words = fleet.outliers(bake).into_iter().map(|outlier| outlier.words());
        words.map(|words| (name(bake), words)).collect::<Vec<_>>()
    });
    let notes = fleet.bakes.iter().flat_map(|bake| bake.notes.iter().map(|note| (name(bake), note.clone())));
    let failures = fleet.failures().map(|(bake, failure)| (name(bake), failure.to_owned()));
    let blocks = [("outliers", block(outliers)), ("notes", block(notes)), ("failed", block(failures))];
    let blocks = blocks.into_iter().filter(|(_, lines)| !lines.is_empty());
    blocks.fold(table.to_string(), |text, (title, lines)| format!("{text}\n{title}\n{lines}"))
}

/// Returns a line for each name and sentence.
fn block(lines: impl Iterator<Item = (String, String)>) -> String {
    lines.map(|(name, words)| format!("  {name}: {words}\n")).collect()
}
