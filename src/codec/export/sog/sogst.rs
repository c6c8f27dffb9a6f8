//! `.sogst` of Solipsist Studios, version 1: Gaussians with motion and lifespans in seconds, for players on the web.
//!
//! In: moving [`Columns`]. Out: a zip archive of `meta.json` and of textures for each group of Gaussians, in the order
//! in which a player needs them.
//!
//! The temporal mean is coded first, and the mean is evaluated at the coded time: the path of a Gaussian does not
//! change, and only its envelope moves by the error of the code.

use super::archive::{self, Entry};
use super::attributes::{Attributes, Texels, encode};
use super::codebook::Codebook;
use super::segments::{REACH, SPAN, Segments};
use super::wide::Wide;
use crate::codec::export::clip::Clip;
use crate::codec::export::y_up::y_down;
use crate::codec::import::columns::{Columns, Motion};
use crate::gaussian::Lifespan;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::io::{self, Write};

/// Temporal deviation of a Gaussian that is always present, in clip lengths: its marginal is 1 in single precision.
const ALWAYS: f64 = 1e4;

/// Time in seconds.
#[derive(Debug, Clone, Copy)]
struct Clock {
    /// First and last second.
    seconds: [f64; 2],
    /// First timestamp, and timestamp units in a second.
    first: f64,
    units: f64,
}

/// The motion of all Gaussians, coded.
struct Moving {
    means: Vec<[f64; 3]>,
    velocities: Wide,
    /// Codes of the temporal mean and of the temporal deviation.
    codes: Vec<[u8; 2]>,
    centers: Codebook,
    /// Logarithms.
    sigmas: Codebook,
    lifespans: Vec<Lifespan>,
}

/// Writes moving Gaussians.
///
/// # Errors
/// Errors of the writer; more Gaussians than a picture has pixels.
pub(in crate::codec::export) fn write(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let columns = &*y_down(columns, clip.up)?;
    let clock = Clock::of(clip);
    let moving = Moving::of(columns, clock);
    let attributes = Attributes::of(columns, &moving.means);
    let segments = Segments::of(&moving.lifespans, clock.seconds, &attributes.places());
    let mut textures = attributes.textures();
    textures.extend(moving.textures());
    let labels: Vec<_> = attributes.labels().into_iter().collect();

    let mut groups = Vec::new();
    if segments.persistent > 0 {
        groups.push(("persistent".to_owned(), 0..segments.persistent));
    }
    let mut names = Vec::new();
    for (number, segment) in segments.list.iter().enumerate() {
        let name = (!segment.range.is_empty()).then(|| format!("seg_{number:03}"));
        groups.extend(name.clone().map(|name| (name, segment.range.clone())));
        names.push(name);
    }
    let of_groups = |textures: &[(&'static str, Texels<'_>)]| -> io::Result<Vec<Vec<Entry>>> {
        groups
            .par_iter()
            .map(|(name, range)| encode(&format!("{name}/"), &segments.order[range.clone()], textures))
            .collect()
    };
    let geometry = of_groups(&textures)?;
    let mut colors: Vec<Entry> = attributes.centroids()?.into_iter().collect();
    colors.extend(of_groups(&labels)?.into_iter().flatten());

    let mut meta = json!({
        "version": 1,
        "format": "sogst",
        "time": { "min": clock.seconds[0], "max": clock.seconds[1], "fps": clip.fps },
        "segments": {
            "duration": segments.duration,
            "k_sigma": REACH,
            "persistent_span_mult": SPAN,
            "persistent": [0, segments.persistent],
            "list": segments.list.iter().map(|segment| {
                json!({ "t0": segment.times[0], "t1": segment.times[1], "range": [segment.range.start, segment.range.end] })
            }).collect::<Vec<Value>>(),
        },
        "streams": {
            "persistent": (segments.persistent > 0).then_some("persistent"),
            "segments": names,
            "sh_deferred": !labels.is_empty(),
        },
    });
    attributes.describe(&mut meta);
    moving.describe(&mut meta);
    let size = |entries: &[Vec<Entry>]| entries.iter().flatten().map(Entry::size).sum();
    // What a player draws first: the Gaussians of every time, and the first segment that has any.
    let first = usize::from(segments.persistent > 0) + 1;
    let meta = with_offsets(meta, size(&geometry[..first.min(geometry.len())]), size(&geometry))?;
    archive::write([&meta].into_iter().chain(geometry.iter().flatten()).chain(&colors), writer)
}

/// Returns `meta.json` with the offsets in the archive at which a player can begin, and at which view-dependent color
/// begins. They depend on the length of their own text; a larger offset never shortens it, so the repetition ends.
fn with_offsets(mut meta: Value, first: usize, all: usize) -> io::Result<Entry> {
    let mut entry = Entry { name: "meta.json".to_owned(), bytes: Vec::new() };
    loop {
        let before = entry.size();
        meta["streams"]["reveal_bytes"] = json!(before + first);
        meta["streams"]["geometry_bytes"] = json!(before + all);
        entry.bytes = serde_json::to_vec(&meta)?;
        if entry.size() == before {
            return Ok(entry);
        }
    }
}

impl Clock {
    /// Returns the clock of a clip: its timestamps if these are seconds, else seconds from 0.
    fn of(clip: &Clip) -> Self {
        let [first, last] = clip.time_interval.map(f64::from);
        let span = last - first;
        let duration = f64::from(clip.duration_seconds);
        // A still is shown for as many seconds as it has timestamp units.
        if duration <= 0.0 || (duration - span).abs() <= 1e-6 * span {
            return Self { seconds: [first, last], first: 0.0, units: 1.0 };
        }
        Self { seconds: [0.0, duration], first, units: span / duration }
    }

    /// Returns a lifespan in seconds. A Gaussian of every time gets the middle of the clip.
    fn lifespan(&self, Motion { mean_t, sigma_t, .. }: &Motion) -> [f64; 2] {
        if sigma_t.is_finite() {
            return [(f64::from(*mean_t) - self.first) / self.units, f64::from(*sigma_t) / self.units];
        }
        [f64::midpoint(self.seconds[0], self.seconds[1]), ALWAYS * (self.seconds[1] - self.seconds[0])]
    }

    /// Returns the timestamp of a second.
    fn timestamp(&self, second: f64) -> f64 {
        self.first + second * self.units
    }
}

impl Moving {
    fn of(columns: &Columns, clock: Clock) -> Self {
        let motion = &columns.motion;
        let centers = Codebook::of(motion.par_iter().map(|motion| clock.lifespan(motion)[0] as f32));
        let log = |motion: &Motion| clock.lifespan(motion)[1].ln() as f32;
        let sigmas = Codebook::of(motion.par_iter().map(log));
        let code = |motion: &Motion| [centers.code(clock.lifespan(motion)[0] as f32), sigmas.code(log(motion))];
        let codes: Vec<[u8; 2]> = motion.par_iter().map(code).collect();
        let lifespan =
            |&[center, sigma]: &[u8; 2]| Lifespan { mean_t: centers.at(center), sigma_t: sigmas.at(sigma).exp() };
        let lifespans: Vec<Lifespan> = codes.par_iter().map(lifespan).collect();
        let mean = |((mean, motion), lifespan): ((&[f32; 3], &Motion), &Lifespan)| {
            let since = clock.timestamp(f64::from(lifespan.mean_t)) - f64::from(motion.mean_t);
            std::array::from_fn(|axis| f64::from(mean[axis]) + f64::from(motion.velocity[axis]) * since)
        };
        let means = columns.mean.par_iter().zip(motion).zip(&lifespans).map(mean).collect();
        let velocities: Vec<[f64; 3]> =
            motion.iter().map(|motion| motion.velocity.map(|velocity| f64::from(velocity) * clock.units)).collect();
        Self { means, velocities: Wide::of(&velocities), codes, centers, sigmas, lifespans }
    }

    /// Returns the textures with a texel for each Gaussian.
    fn textures(&self) -> [(&'static str, Texels<'_>); 3] {
        let lifespan = |index: usize| {
            let [center, sigma] = self.codes[index];
            [center, sigma, 0, u8::MAX]
        };
        [
            ("motion_l.webp", Box::new(|index| self.velocities.low(index))),
            ("motion_u.webp", Box::new(|index| self.velocities.high(index))),
            ("trbf.webp", Box::new(lifespan)),
        ]
    }

    /// Adds the description of the motion to `meta.json`.
    fn describe(&self, meta: &mut Value) {
        let sigmas: Vec<f32> = self.sigmas.entries().into_iter().map(f32::exp).collect();
        meta["motion"] = self.velocities.described(["motion_l.webp", "motion_u.webp"]);
        meta["motion"]["degree"] = json!(1);
        meta["trbf"] = json!({
            "center": { "codebook": self.centers.entries() },
            "sigma": { "codebook": sigmas },
            "files": ["trbf.webp"],
        });
    }
}
