//! `gs4d compare A B`: how alike pictures are.
//!
//! In: two pictures, or two folders matched by file stem (8-bit, 16-bit or raw float32). Out: PSNR and SSIM of each pair and
//! their means.

use super::failure::Failure;
use super::report::{Report, Table, progress};
use super::values;
use crate::offline::metrics;
use crate::view::Picture;
use glam::{UVec2, Vec3};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Measure how alike two pictures, or the pictures of two folders, are.
///
/// Pictures are png, jpg or .f32 (what `render --raw` writes; needs --size). Alpha is ignored. Values of .f32 files are taken
/// as they are when both sides are .f32, and clamped to 0..1 against any other picture.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d compare frames/r_000.png truth/r_000.png
  gs4d compare frames truth
  gs4d compare frames/r_000.f32 other/r_000.f32 --size 400x400

PSNR is the mean of the three channels' (as the original code reports it), pooled that of all values together; of equal
pictures it is infinite: `inf`, null in JSON.")]
pub struct Compare {
    /// A picture or a folder of pictures.
    #[arg(value_name = "A")]
    a: PathBuf,
    /// A picture or a folder of pictures.
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Size of .f32 pictures. In folders, .f32 files count only with this option, and then before others of the same stem.
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    size: Option<UVec2>,
}

/// `ImageMetrics` of one pair, or the means of all.
struct ImageMetrics {
    psnr: f64,
    pooled: f64,
    ssim: f64,
}

impl Compare {
    /// Compares and tabulates.
    pub fn run(&self) -> Result<Report, Failure> {
        let pairs = self.pairs()?;
        let mut rows = Vec::new();
        let bar = progress(pairs.both.len(), "comparing");
        for (name, a, b) in &pairs.both {
            rows.push((name.clone(), self.compare(a, b)?));
            bar.inc(1);
        }
        bar.finish_and_clear();
        let mean = ImageMetrics::mean(&rows);
        let mut table = Table::new(&["picture", "PSNR", "pooled", "SSIM"]);
        for (name, likeness) in &rows {
            table.row(likeness.cells(name));
        }
        if rows.len() > 1 {
            table.row(mean.cells(&format!("mean of {}", rows.len())));
        }
        let mut text = table.to_string();
        for (folder, names) in [(&self.a, &pairs.only_a), (&self.b, &pairs.only_b)] {
            if !names.is_empty() {
                text += &format!("only in {}: {}\n", folder.display(), names.join(", "));
            }
        }
        let pictures: Vec<Value> = rows.iter().map(|(name, likeness)| likeness.json(Some(name))).collect();
        let json = json!({
            "pictures": pictures,
            "mean": mean.json(None),
            "only_in_a": pairs.only_a,
            "only_in_b": pairs.only_b,
        });
        Ok(Report::new(json, text))
    }

    fn pairs(&self) -> Result<Pairs, Failure> {
        match (self.a.is_dir(), self.b.is_dir()) {
            (true, true) => self.pairs_of_folders(),
            (false, false) => {
                let name = self.a.file_name().unwrap_or_default().to_string_lossy().into_owned();
                Ok(Pairs { both: vec![(name, self.a.clone(), self.b.clone())], ..Pairs::default() })
            }
            (true, false) => Err(Failure::about(&self.b, "is not a folder, but the other one is")),
            (false, true) => Err(Failure::about(&self.a, "is not a folder, but the other one is")),
        }
    }

    fn pairs_of_folders(&self) -> Result<Pairs, Failure> {
        let (a, mut b) = (self.pictures(&self.a)?, self.pictures(&self.b)?);
        let mut pairs = Pairs::default();
        for (stem, path) in a {
            let name = stem.to_string_lossy().into_owned();
            match b.remove(&stem) {
                Some(other) => pairs.both.push((name, path, other)),
                None => pairs.only_a.push(name),
            }
        }
        pairs.only_b.extend(b.into_keys().map(|stem| stem.to_string_lossy().into_owned()));
        if pairs.both.is_empty() {
            let (a, b) = (self.a.display(), self.b.display());
            return Err(Failure::new(format!("{a} and {b}: no two pictures with the same name before the extension")));
        }
        Ok(pairs)
    }

    /// The pictures of a folder by file stem.
    fn pictures(&self, folder: &Path) -> Result<BTreeMap<OsString, PathBuf>, Failure> {
        let mut found: BTreeMap<OsString, PathBuf> = BTreeMap::new();
        for entry in fs::read_dir(folder).map_err(|error| Failure::at(folder, &error))? {
            let path = entry.map_err(|error| Failure::at(folder, &error))?.path();
            let raw = is_raw(&path);
            let Some(stem) = path.file_stem().filter(|_| is_picture(&path) || (raw && self.size.is_some())) else {
                continue;
            };
            match found.get(stem) {
                Some(other) if is_raw(other) == raw => {
                    let message = format!("has the same name before the extension as {}", other.display());
                    return Err(Failure::about(&path, &message));
                }
                Some(_) if !raw => {}
                _ => drop(found.insert(stem.to_owned(), path)),
            }
        }
        Ok(found)
    }

    fn compare(&self, a: &Path, b: &Path) -> Result<ImageMetrics, Failure> {
        let (mut left, mut right) = (self.load(a)?, self.load(b)?);
        if !(is_raw(a) && is_raw(b)) {
            (left, right) = (left.clamped(), right.clamped());
        }
        let mismatch = |error: metrics::SizeMismatch| Failure::at(b, &error);
        Ok(ImageMetrics {
            psnr: metrics::psnr(&left, &right).map_err(mismatch)?,
            pooled: metrics::psnr_pooled(&left, &right).map_err(mismatch)?,
            ssim: metrics::ssim(&left, &right).map_err(mismatch)?,
        })
    }

    fn load(&self, path: &Path) -> Result<Picture, Failure> {
        if is_raw(path) {
            return self.load_raw(path);
        }
        let image = image::open(path).map_err(|error| Failure::at(path, &error))?.into_rgb32f();
        let size = UVec2::new(image.width(), image.height());
        Ok(Picture { size, pixels: image.pixels().map(|pixel| Vec3::from(pixel.0)).collect() })
    }

    fn load_raw(&self, path: &Path) -> Result<Picture, Failure> {
        let size =
            self.size.ok_or_else(|| Failure::about(path, "a raw picture does not tell its size: give --size WxH"))?;
        let expected = u64::from(size.x) * u64::from(size.y) * 12;
        let found = fs::metadata(path).map_err(|error| Failure::at(path, &error))?.len();
        if found != expected {
            let message = format!("{found} bytes, but a raw picture of {}x{} has {expected}", size.x, size.y);
            return Err(Failure::about(path, &message));
        }
        let bytes = fs::read(path).map_err(|error| Failure::at(path, &error))?;
        let values: Vec<f32> =
            bytes.chunks_exact(4).map(|value| f32::from_le_bytes([value[0], value[1], value[2], value[3]])).collect();
        if values.iter().any(|value| !value.is_finite()) {
            return Err(Failure::about(path, "holds a value that is not finite"));
        }
        Ok(Picture { size, pixels: values.chunks_exact(3).map(Vec3::from_slice).collect() })
    }
}

/// What is compared with what.
#[derive(Default)]
struct Pairs {
    both: Vec<(String, PathBuf, PathBuf)>,
    only_a: Vec<String>,
    only_b: Vec<String>,
}

impl ImageMetrics {
    fn mean(rows: &[(String, Self)]) -> Self {
        let mean =
            |of: fn(&Self) -> f64| rows.iter().map(|(_, likeness)| of(likeness)).sum::<f64>() / rows.len() as f64;
        Self { psnr: mean(|l| l.psnr), pooled: mean(|l| l.pooled), ssim: mean(|l| l.ssim) }
    }

    fn cells(&self, name: &str) -> [String; 4] {
        let Self { psnr, pooled, ssim } = self;
        [name.to_owned(), format!("{psnr:.3}"), format!("{pooled:.3}"), format!("{ssim:.5}")]
    }

    fn json(&self, name: Option<&str>) -> Value {
        let mut json = json!({ "psnr": self.psnr, "psnr_pooled": self.pooled, "ssim": self.ssim });
        if let Some(name) = name {
            json["name"] = name.into();
        }
        json
    }
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|found| extensions.iter().any(|extension| found.eq_ignore_ascii_case(extension)))
}

fn is_raw(path: &Path) -> bool {
    has_extension(path, &["f32"])
}

fn is_picture(path: &Path) -> bool {
    has_extension(path, &["png", "jpg", "jpeg"])
}
