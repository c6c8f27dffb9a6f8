//! The report of a bake as one HTML page.
//!
//! In: a [`BakeReport`]. Out: HTML with its style, its plots (SVG) and its pictures (PNG, base64) inside: it loads
//! nothing.

use super::html::{Page, card, element, escape, paragraph, table};
use super::plot::{Axis, Chart, Series, bars};
use super::{BakeReport, Sample, SectionSize};
use crate::offline::measure::MeanMetrics;
use crate::offline::measure::evaluation::{color_name, without_contrast};
use crate::offline::train::CurvePoint;
use crate::view::Picture;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use image::codecs::png::PngEncoder;
use image::imageops::{self, FilterType};

/// The style besides that of all pages.
const STYLE: &str = include_str!("bake_page.css");
/// Largest width of the pictures, pixels.
const PICTURE_WIDTH: u32 = 480;
/// Factor on differences, so that they are visible.
const GAIN: f32 = 5.0;

impl BakeReport {
    /// Returns the HTML page.
    pub fn html(&self) -> String {
        let Self { checkpoint, data, generator, .. } = self;
        let cards = [
            warnings(self),
            card("", "In short", &in_short(self)),
            card("", "Choices", &choices(self)),
            sections(self),
            trials(self),
            fine_tuning(self),
            variances(self),
            activity(self),
            overlap(self),
            card("", "Stages", &stages(self)),
            samples(&self.samples),
        ];
        Page {
            title: &self.package,
            about: &format!("baked from {checkpoint} with the views of {data} by {generator}"),
            style: STYLE,
            body: &element("div", "cards", &cards.concat()),
            script: "",
        }
        .html()
    }
}

/// Returns a card with a note.
fn noted(title: &str, note: &str, body: &str) -> String {
    card("", title, &(paragraph("soft", note) + body))
}

/// Returns a card with the warnings; nothing if there are none.
fn warnings(report: &BakeReport) -> String {
    match report.warnings.iter().map(|warning| paragraph("", warning)).collect::<String>() {
        none if none.is_empty() => none,
        paragraphs => card("", "Warnings", &paragraphs),
    }
}

/// Returns a table of text.
fn text_table(heads: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let head: String = heads.iter().map(|text| element("th", "", &escape(text))).collect();
    let cells = |row: Vec<String>| row.iter().map(|text| element("td", "", &escape(text))).collect::<String>();
    table(&head, rows.into_iter().map(|row| element("tr", "", &cells(row))))
}

fn in_short(report: &BakeReport) -> String {
    text_table(&["", "checkpoint", "package"], figures(report)) + &paragraph("soft", &about_metrics(report))
}

/// Returns names and figures of the checkpoint and of the package.
fn figures(report: &BakeReport) -> Vec<Vec<String>> {
    let row = |name: &str, before: String, after: String| vec![name.to_owned(), before, after];
    let (count, bytes) = (report.gaussians, report.bytes);
    let each = |bytes: u64, count: usize| format!("{:.1}", bytes as f64 / count.max(1) as f64);
    let mut rows = vec![
        row("Gaussians", count.before.to_string(), count.after.to_string()),
        row("MB", megabytes(bytes.before), megabytes(bytes.after)),
        row("bytes per Gaussian", each(bytes.before, count.before), each(bytes.after, count.after)),
    ];
    if let Some(evaluation) = &report.evaluation {
        let (before, after) = (&evaluation.before.mean, &evaluation.after.mean);
        let mut metric = |name: &str, digits: usize, of: fn(&MeanMetrics) -> Option<f64>| {
            if let (Some(before), Some(after)) = (of(before), of(after)) {
                rows.push(row(name, format!("{before:.digits$}"), format!("{after:.digits$}")));
            }
        };
        metric("PSNR, dB", 2, |l| Some(l.psnr));
        metric("PSNR pooled, dB", 2, |l| Some(l.psnr_pooled));
        metric("SSIM", 4, |l| l.ssim);
        metric("MS-SSIM", 4, |l| l.ms_ssim);
        metric("FLIP (0 is best)", 4, |l| l.flip);
        if let (Some(before), Some(after)) = (evaluation.before.contrast, evaluation.after.contrast) {
            let (over, before, after) = (color_name(after.background), before.mean, after.mean);
            let mut metric = |name: &str, before: f64, after: f64| {
                rows.push(row(&format!("{name} over {over}, dB"), format!("{before:.2}"), format!("{after:.2}")));
            };
            metric("PSNR", before.psnr, after.psnr);
            metric("PSNR pooled", before.psnr_pooled, after.psnr_pooled);
        }
    }
    rows
}

/// Returns what the metrics are measured on, as a sentence.
fn about_metrics(report: &BakeReport) -> String {
    match (&report.evaluation, &report.split) {
        (Some(evaluation), Some(split)) => {
            let after = &evaluation.after;
            let behind = match after.contrast {
                Some(_) => format!("Where no background is named, it is {}.", color_name(after.background)),
                None => format!("One background: {}.", without_contrast(after)),
            };
            let identical = |name: &str, mean: &MeanMetrics| {
                mean.identical_in_words("views").map_or(String::new(), |words| format!(" Of the {name}, {words}."))
            };
            format!(
                "Metrics: means over the {} views of the {split} split; pooled is the PSNR of all values of all views together. \
                 {behind}{}{}",
                after.views.len(),
                identical("checkpoint", &evaluation.before.mean),
                identical("package", &after.mean),
            )
        }
        _ => "Metrics were not measured: the images of the test split are not there.".to_owned(),
    }
}

fn choices(report: &BakeReport) -> String {
    text_table(&["", ""], report.choices.iter().map(|(name, value)| vec![name.clone(), value.clone()]))
}

fn stages(report: &BakeReport) -> String {
    let took = |skipped, seconds: f64| if skipped { "done before".to_owned() } else { format!("{seconds:.1}") };
    text_table(&["stage", "seconds"], report.stages.iter().map(|s| vec![s.name.clone(), took(s.skipped, s.seconds)]))
}

fn sections(report: &BakeReport) -> String {
    let all: u64 = report.sections.iter().map(|section| section.bytes).sum();
    let row = |section: &SectionSize| {
        let share = 100.0 * section.bytes as f64 / all.max(1) as f64;
        (section.name.clone(), section.bytes as f64, format!("{} MB, {share:.0} %", megabytes(section.bytes)))
    };
    let rows: Vec<_> = report.sections.iter().map(row).collect();
    noted("Size by section", "Bytes in the package, compressed.", &bars(&rows))
}

fn trials(report: &BakeReport) -> String {
    let mut series: Vec<Series> = Vec::new();
    for trial in &report.trials {
        let point = [100.0 * trial.ratio, trial.psnr];
        match series.iter_mut().find(|s| s.name == trial.variant) {
            Some(series) => series.points.push(point),
            None => series.push(Series { name: trial.variant.clone(), points: vec![point], dots: true }),
        }
    }
    if series.is_empty() {
        return String::new();
    }
    series.iter_mut().for_each(|s| s.points.sort_by(|a, b| a[0].total_cmp(&b[0])));
    let chart = Chart { x: Axis::new("removed, %"), y: Axis::new("PSNR, dB"), series };
    let note = "Held-out training views, drawn from what each score keeps, before any fine-tuning.";
    plotted("PSNR against prune ratio", note, &chart)
}

fn fine_tuning(report: &BakeReport) -> String {
    let curve = &report.fine_tuning;
    if curve.is_empty() {
        return String::new();
    }
    let line = |name: &str, psnr: fn(&CurvePoint) -> Option<f64>| Series {
        name: name.to_owned(),
        points: curve.iter().filter_map(|point| Some([point.step as f64, psnr(point)?])).collect(),
        dots: true,
    };
    let series = vec![line("validation views", |point| point.psnr), line("views trained on", |p| p.training_psnr)];
    let chart = Chart { x: Axis::new("steps"), y: Axis::new("PSNR, dB"), series };
    plotted("Fine-tuning", "Training views, before compression. Those trained on are over random backgrounds.", &chart)
}

fn variances(report: &BakeReport) -> String {
    let histogram = &report.variances;
    let middle = |i: usize| (histogram.borders[i] * histogram.borders[i + 1]).sqrt();
    let line = |name: &str, shares: &[f64]| Series {
        name: name.to_owned(),
        points: shares.iter().enumerate().map(|(i, share)| [middle(i), 100.0 * share]).collect(),
        dots: false,
    };
    let chart = Chart {
        x: Axis { log: true, ..Axis::new("temporal variance Σt, timestamp units squared") },
        y: Axis::new("Gaussians, %"),
        series: vec![line("checkpoint", &histogram.before), line("package", &histogram.after)],
    };
    plotted("Temporal variance", "Small variances flash by, large ones stay.", &chart)
}

fn activity(report: &BakeReport) -> String {
    let mut series = vec![
        percent_line(report, "checkpoint", &report.activity.before.share),
        percent_line(report, "package", &report.activity.after.share),
    ];
    if let Some(shares) = &report.filter_share {
        series.push(percent_line(report, "package, let through by the filter", shares));
    }
    let chart = Chart { x: Axis::new("time"), y: Axis { range: Some([0.0, 100.0]), ..Axis::new("active, %") }, series };
    plotted("Active ratio over time", "Share of the Gaussians whose marginal exceeds the cut-off at that time.", &chart)
}

fn overlap(report: &BakeReport) -> String {
    let series = vec![
        percent_line(report, "checkpoint", &report.activity.before.overlap),
        percent_line(report, "package", &report.activity.after.overlap),
    ];
    let chart = Chart { x: Axis::new("time"), y: Axis { range: Some([0.0, 100.0]), ..Axis::new("IoU, %") }, series };
    plotted("IoU of active sets over time", "The set active at each time against the set active at the first.", &chart)
}

fn percent_line(report: &BakeReport, name: &str, shares: &[f64]) -> Series {
    let points = report.times.iter().zip(shares).map(|(&time, share)| [f64::from(time), 100.0 * share]);
    Series { name: name.to_owned(), points: points.collect(), dots: false }
}

fn plotted(title: &str, note: &str, chart: &Chart) -> String {
    noted(title, note, &(chart.svg() + &element("p", "", &chart.legend())))
}

fn samples(samples: &[Sample]) -> String {
    if samples.is_empty() {
        return String::new();
    }
    let view = |sample: &Sample| {
        let difference = difference(&sample.reference, &sample.after);
        let figures: String = [
            ("reference", &sample.reference),
            ("checkpoint", &sample.before),
            ("package", &sample.after),
            ("difference of the package, x 5", &difference),
        ]
        .into_iter()
        .map(|(what, picture)| {
            let (name, data) = (escape(&sample.name), png_data(picture));
            let image = format!("<img src=\"{data}\" alt=\"{name}, {what}\">");
            element("figure", "", &(image + &element("figcaption", "", &format!("{name}: {what}"))))
        })
        .collect();
        element("div", "views", &figures)
    };
    card("wide", "Views", &samples.iter().map(view).collect::<String>())
}

/// Returns the absolute difference of two pictures of one size, times [`GAIN`].
fn difference(a: &Picture, b: &Picture) -> Picture {
    let pixels = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .map(|(p, q)| ((*p - q.clamp(Vec3::ZERO, Vec3::ONE)).abs() * GAIN).min(Vec3::ONE));
    Picture { size: a.size, pixels: pixels.collect() }
}

/// Returns a picture as the source of an `img`; empty if it cannot be encoded.
fn png_data(picture: &Picture) -> String {
    let mut image = picture.to_rgb8();
    if image.width() > PICTURE_WIDTH {
        let height = (f64::from(image.height()) * f64::from(PICTURE_WIDTH) / f64::from(image.width())).round().max(1.0);
        image = imageops::resize(&image, PICTURE_WIDTH, height as u32, FilterType::Triangle);
    }
    let mut png = Vec::new();
    match image.write_with_encoder(PngEncoder::new(&mut png)) {
        Ok(()) => format!("data:image/png;base64,{}", STANDARD.encode(png)),
        Err(_) => String::new(),
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.2}", bytes as f64 / 1e6)
}
