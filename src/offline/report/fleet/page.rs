//! The report over many bakes as one HTML page.
//!
//! In: a [`FleetReport`], the path of the page. Out: HTML with its style, its drawings and its script inside: it loads
//! nothing, and works from a disk. Packages and their own pages are links relative to the page. Without scripts, the
//! table cannot be sorted and searched.

use super::bake::{Bake, Reported};
use super::fleet_report::FleetReport;
use super::measure::{MEASURES, Measure};
use super::outliers::{FEWEST, LIMIT, Outlier};
use super::strip::{Dot, strip};
use crate::offline::report::html::{Page, card, element, escape, paragraph, table};
use std::path::{Component, Path, PathBuf};

/// The style besides that of all pages.
const STYLE: &str = include_str!("page.css");
/// The script, which sorts and searches the table.
const SCRIPT: &str = include_str!("page.js");

/// The fields that search and filter the table.
const FORM: &str = "<form><input type=\"search\" placeholder=\"Find\" aria-label=\"Find\">\
     <select aria-label=\"Which bakes\"><option value=\"\">all</option><option value=\"far\">with outliers</option>\
     <option value=\"bad\">failed</option></select><span class=\"soft\" id=\"shown\"></span></form>";

impl FleetReport {
    /// Returns the HTML page that is to be written to `page`.
    pub(crate) fn html(&self, page: &Path) -> String {
        let count = self.bakes.len();
        let title = if count == 1 { "1 bake".to_owned() } else { format!("{count} bakes") };
        let parts = [self.in_short(), self.strips(), self.failures_card(), self.table(page)];
        Page {
            title: &title,
            about: concat!("by gs4d ", env!("CARGO_PKG_VERSION")),
            style: STYLE,
            body: &parts.concat(),
            script: SCRIPT,
        }
        .html()
    }

    fn in_short(&self) -> String {
        let sum = |of: fn(&Bake) -> Option<f64>| self.bakes.iter().filter_map(of).sum::<f64>();
        let failed = self.failures().count();
        let unusual = self.bakes.iter().filter(|bake| !self.outliers(bake).is_empty()).count();
        let bytes = sum(|bake| Some(bake.figures.as_ref()?.bytes as f64));
        let of_checkpoints = sum(|bake| reported(bake)?.bytes.map(|bytes| bytes as f64));
        let of_theirs = sum(|bake| reported(bake)?.bytes.and(bake.figures.as_ref()).map(|f| f.bytes as f64));
        let seconds = sum(|bake| Some(reported(bake)?.seconds));
        let gaussians = sum(|bake| Some(bake.figures.as_ref()?.gaussians as f64));
        let mut tiles = vec![
            tile("packages", &self.bakes.len().to_string(), ""),
            tile("failed", &failed.to_string(), if failed > 0 { "bad" } else { "" }),
            tile("with outliers", &unusual.to_string(), if unusual > 0 { "far" } else { "" }),
            tile("all packages", &size(bytes), ""),
            tile("Gaussians", &grouped(gaussians), ""),
            tile("of baking", &duration(seconds), ""),
        ];
        if of_checkpoints > 0.0 && of_theirs > 0.0 {
            tiles.insert(4, tile("smaller than checkpoints", &format!("{:.1}×", of_checkpoints / of_theirs), ""));
        }
        element("div", "tiles", &tiles.concat())
    }

    /// Returns the distributions of all measures.
    fn strips(&self) -> String {
        let shown: Vec<String> = self.bakes.iter().map(|bake| bake.package.display().to_string()).collect();
        let distribution = |(measure, usual): (&Measure, &Option<_>)| {
            let bakes = self.bakes.iter().zip(&shown).enumerate();
            let dots: Vec<Dot> =
                bakes.filter_map(|(row, (bake, name))| Some(Dot { row, name, value: measure.of(bake)? })).collect();
            match strip(measure, usual.as_ref(), &dots) {
                drawing if drawing.is_empty() => String::new(),
                drawing => card("", measure.head, &drawing),
            }
        };
        let cards: String = MEASURES.iter().zip(&self.usual).map(distribution).collect();
        let note = format!(
            "Each dot is a bake. The band has the usual values, the line their median: an outlier lies more than {LIMIT} robust standard \
             deviations (1.4826 times the median absolute deviation) from it; sizes, counts and times are compared by factors. Fewer than \
             {FEWEST} bakes have no outliers."
        );
        element("div", "strips", &cards) + &paragraph("soft", &note)
    }

    fn failures_card(&self) -> String {
        let line = |(bake, failure): (&Bake, &str)| {
            let name = element("b", "", &escape(&bake.package.display().to_string()));
            element("li", "", &format!("{name} {}", escape(failure)))
        };
        match self.failures().map(line).collect::<String>() {
            lines if lines.is_empty() => lines,
            lines => card("bad", "Failed", &element("ul", "", &lines)),
        }
    }

    fn table(&self, page: &Path) -> String {
        let head = |name: &str, class: &str| {
            element("th", class, &format!("<button type=\"button\">{}</button>", escape(name)))
        };
        let measures: String = MEASURES.iter().map(|measure| head(measure.head, "")).collect();
        let heads = [head("package", "words"), head("form", "words"), measures, head("remarks", "words")].concat();
        let rows = self.bakes.iter().enumerate().map(|(row, bake)| self.row(row, bake, page));
        let table = element("div", "wide", &table(&heads, rows));
        element("section", "card", &(FORM.to_owned() + &table))
    }

    fn row(&self, row: usize, bake: &Bake, page: &Path) -> String {
        let outliers = self.outliers(bake);
        let of = |measure: &Measure| outliers.iter().find(|outlier| outlier.measure.id == measure.id);
        let cells: String = MEASURES.iter().map(|measure| cell(measure, measure.of(bake), of(measure))).collect();
        let class = match (&bake.failure, outliers.is_empty()) {
            (Some(_), _) => "bad",
            (None, false) => "far",
            (None, true) => "",
        };
        let form = bake.figures.as_ref().map_or("", |figures| figures.form);
        let [name, form] = [("words name", name(bake, page)), ("words", form.to_owned())]
            .map(|(classes, body)| element("td", classes, &body));
        let remarks = element("td", "words remarks", &remarks(bake, &outliers));
        format!("<tr id=\"bake-{row}\" class=\"{class}\">{name}{form}{cells}{remarks}</tr>")
    }
}

fn reported(bake: &Bake) -> Option<&Reported> {
    bake.figures.as_ref()?.reported.as_ref()
}

fn tile(what: &str, value: &str, class: &str) -> String {
    let contents = element("b", "", value) + &element("span", "", what);
    element("div", format!("tile {class}").trim_end(), &contents)
}

fn cell(measure: &Measure, value: Option<f64>, outlier: Option<&Outlier>) -> String {
    let Some(value) = value else { return element("td", "none", "–") };
    let shown = measure.shown(value);
    match outlier {
        Some(outlier) => {
            let arrow = if outlier.is_high() { "▲" } else { "▼" };
            let title = escape(&outlier.words());
            format!("<td class=\"far\" data-value=\"{value}\" title=\"{title}\">{arrow} {shown}</td>")
        }
        None => format!("<td data-value=\"{value}\">{shown}</td>"),
    }
}

/// Returns the name of a package, as a link to its own page, or to the package if it has none.
fn name(bake: &Bake, page: &Path) -> String {
    let shown = escape(&bake.package.display().to_string());
    let target = bake.page.as_ref().unwrap_or(&bake.package);
    match link(page, target) {
        Some(link) if target.exists() => format!("<a href=\"{}\">{shown}</a>", escape(&link)),
        _ => shown,
    }
}

fn remarks(bake: &Bake, outliers: &[Outlier]) -> String {
    let failure = bake.failure.iter().map(|failure| paragraph("bad", failure));
    let outliers = outliers.iter().map(|outlier| paragraph("", &outlier.words()));
    let notes = bake.notes.iter().map(|note| paragraph("", note));
    let choices = reported(bake).map(|reported| &reported.choices).filter(|choices| !choices.is_empty());
    let choices = choices.map(|choices| {
        let lines: Vec<String> = choices.iter().map(|(name, value)| format!("{name}: {value}")).collect();
        let contents = element("summary", "", "choices") + &element("pre", "", &escape(&lines.join("\n")));
        element("details", "", &contents)
    });
    failure.chain(outliers).chain(notes).chain(choices).collect()
}

/// Returns the link from a page to a file, relative to the page; `None` if there is no relative path, as between two
/// drives.
fn link(page: &Path, file: &Path) -> Option<String> {
    let folder = page.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let resolved = |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path)).ok();
    let (from, to) = (resolved(folder)?, resolved(file)?);
    let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return None;
    }
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    let relative: PathBuf = up.chain(to.components().skip(shared)).collect();
    let parts = relative.components().map(|part| encoded(&part.as_os_str().to_string_lossy()));
    Some(parts.collect::<Vec<_>>().join("/"))
}

/// Returns a name as part of a link.
fn encoded(name: &str) -> String {
    let encoded = |byte: u8| match byte {
        b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    };
    name.bytes().map(encoded).collect()
}

fn size(bytes: f64) -> String {
    if bytes < 1e9 { format!("{:.1} MB", bytes / 1e6) } else { format!("{:.2} GB", bytes / 1e9) }
}

fn duration(seconds: f64) -> String {
    match seconds {
        _ if seconds < 120.0 => format!("{seconds:.0} s"),
        _ if seconds < 7200.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

/// Returns a whole number with a narrow space after each three digits.
fn grouped(number: f64) -> String {
    let digits = format!("{number:.0}");
    let place = |(index, digit): (usize, char)| {
        let is_group = index > 0 && (digits.len() - index).is_multiple_of(3);
        [is_group.then_some('\u{202f}'), Some(digit)].into_iter().flatten().collect::<Vec<_>>()
    };
    digits.chars().enumerate().flat_map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_lead_from_the_page_to_the_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(path("pages")).expect("the folder can be written to");
        std::fs::write(path("a #1.gs4d"), "").expect("the folder can be written to");
        assert_eq!(link(&path("all.html"), &path("a #1.gs4d")).as_deref(), Some("a%20%231.gs4d"), "beside the page");
        let up = link(&path("pages/all.html"), &path("a #1.gs4d"));
        assert_eq!(up.as_deref(), Some("../a%20%231.gs4d"), "in the folder above");
    }

    #[test]
    fn names_and_sentences_cannot_add_to_the_page() {
        let bake = Bake {
            package: "<script>.gs4d".into(),
            failure: Some("<b>".to_owned()),
            notes: vec!["\"><i>".to_owned()],
            ..Bake::default()
        };
        let page = FleetReport::of(vec![bake]).html(Path::new("page.html"));
        for text in ["<script>.gs4d", "<b></", "\"><i>"] {
            assert!(!page.contains(text), "{text} is escaped");
        }
        assert!(page.contains("&lt;script&gt;.gs4d"), "and shown");
    }

    #[test]
    fn numbers_are_grouped() {
        assert_eq!(grouped(1_234_567.0), "1\u{202f}234\u{202f}567", "after each three digits");
        assert_eq!(grouped(123.0), "123", "three digits are one group");
    }
}
