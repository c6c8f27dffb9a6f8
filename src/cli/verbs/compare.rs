//! `gs4d compare A B`: compares pictures.
//!
//! In: two pictures, or two folders whose pictures are matched by file stem (8-bit, 16-bit or raw float32). Out: PSNR
//! and SSIM of each pair, and their means.

use crate::cli::args::{Given, Need, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::Table;
use crate::offline::measure::comparison::Pairs;
use crate::offline::measure::{ImageMetrics, MeanMetrics};
use crate::offline::work::Progress;
use glam::UVec2;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Measure PSNR and SSIM of two pictures, or of the pictures of two folders.
///
/// Pictures are .png, .jpg or .f32 (written by `gs4d render --raw`; needs --size). Alpha is ignored. Values of .f32
/// pictures are clamped to 0..1, unless both pictures are .f32.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d compare frames/r_000.png truth/r_000.png
  gs4d compare frames truth
  gs4d compare frames/r_000.f32 other/r_000.f32 --size 400x400

PSNR is the mean over the three channels, as the original code reports it; channels without error are left out. Pooled PSNR is that of all
values together. The PSNR of identical pictures is 200 dB. Their number is reported, and they are left out of the mean PSNR.")]
pub(crate) struct Compare {
    #[command(flatten)]
    given: Given,
    /// A picture or a folder of pictures.
    #[arg(value_name = "A")]
    a: PathBuf,
    /// A picture or a folder of pictures.
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Size of .f32 pictures, pixels. In folders, .f32 files are used only with this option, and then in place of other
    /// files of the same stem.
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    size: Option<UVec2>,
}

impl Compare {
    /// Compares the pictures and returns a table.
    ///
    /// # Errors
    /// Pictures that cannot be read or paired, or that have different sizes.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let progress = &mut Bars::default();
        let pairs = Pairs::of(&self.a, &self.b, self.size)?;
        self.given.require(Need::RawPictures, pairs.has_raw())?;
        let mut metrics = Vec::with_capacity(pairs.both.len());
        progress.begin("comparing", pairs.both.len());
        for pair in &pairs.both {
            metrics.push(pair.compare(self.size)?);
            progress.advance();
        }
        progress.finish();
        let mean = MeanMetrics::of(&metrics);
        let rows = || pairs.both.iter().zip(&metrics);
        let mut table = Table::new(&["picture", "PSNR", "pooled", "SSIM"]);
        for (pair, metrics) in rows() {
            let psnr = match metrics.identical {
                true => "identical".to_owned(),
                false => format!("{:.3}", metrics.psnr),
            };
            table.row(cells(&pair.name, psnr, metrics.psnr_pooled, metrics.ssim));
        }
        if let Some(MeanMetrics { psnr, psnr_pooled, ssim, count, .. }) = mean.filter(|mean| mean.count > 1) {
            table.row(cells(&format!("mean of {count}"), format!("{psnr:.3}"), psnr_pooled, ssim));
        }
        let mut text = table.to_string();
        if let Some(sentence) = mean.and_then(|mean| mean.identical_in_words("pictures")) {
            text += &format!("{sentence}\n");
        }
        for (folder, names) in [(&self.a, &pairs.only_a), (&self.b, &pairs.only_b)] {
            if !names.is_empty() {
                text += &format!("only in {}: {}\n", folder.display(), names.join(", "));
            }
        }
        let pictures: Vec<Value> = rows()
            .map(|(pair, &ImageMetrics { psnr, psnr_pooled, identical, ssim, .. })| {
                json!({
                    "name": pair.name,
                    "psnr": psnr,
                    "psnr_pooled": psnr_pooled,
                    "identical": identical,
                    "ssim": ssim,
                })
            })
            .collect();
        let mean = mean.map(|MeanMetrics { psnr, psnr_pooled, identical, ssim, .. }| {
            json!({ "psnr": psnr, "psnr_pooled": psnr_pooled, "identical": identical, "ssim": ssim })
        });
        let json = json!({
            "pictures": pictures,
            "mean": mean,
            "only_in_a": pairs.only_a,
            "only_in_b": pairs.only_b,
        });
        Ok(Report::new(json, text))
    }
}

fn cells(name: &str, psnr: String, pooled: f64, ssim: Option<f64>) -> [String; 4] {
    [name.to_owned(), psnr, format!("{pooled:.3}"), ssim.map_or("-".to_owned(), |ssim| format!("{ssim:.5}"))]
}
