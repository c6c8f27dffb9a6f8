//! `.sogst` of Solipsist Studios, version 1: SOG with motion and lifespans in seconds.
//!
//! In: `meta.json` and its textures, of all Gaussians or of each group of a stream. Out: a moving scene, y down. Its
//! segments are an index for players and are not needed here; paths of degree 2 become straight pieces.

use super::files::Files;
use super::meta::{self, Images, Wide};
use super::sog2::{UP, invisible};
use super::splats::{self, Centroids, Layout, Table, check_codes};
use super::textures::{self, Encoded};
use crate::codec::import::columns::{Columns, Motion, Played};
use crate::codec::import::in_pieces::{in_pieces, middle_scale, splitting, statements};
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;
use crate::gaussian::{Harmonics, SMALLEST_CUTOFF};
use crate::scene::pieces::{ALWAYS, Bends, Curve};
use crate::scene::{MAX_SEGMENTS, TrainedCameras};
use crate::view::RasterFov;
use glam::DVec3;
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;

/// The fields beside those of SOG.
#[derive(Debug, Clone, Deserialize)]
struct Fields {
    time: Time,
    motion: Motions,
    accel: Option<Wide>,
    trbf: Lifespans,
    cov2d_scale: Option<[f64; 2]>,
    segments: Option<Segments>,
    streams: Option<Streams>,
}

/// First and last second.
#[derive(Debug, Clone, Deserialize)]
struct Time {
    min: f64,
    max: f64,
}

#[derive(Debug, Clone, Deserialize)]
struct Motions {
    degree: u64,
    #[serde(flatten)]
    wide: Wide,
}

/// Temporal means and deviations, seconds.
#[derive(Debug, Clone, Deserialize)]
struct Lifespans {
    center: Codebook,
    sigma: Codebook,
    files: [String; 1],
}

#[derive(Debug, Clone, Deserialize)]
struct Codebook {
    codebook: Vec<Option<f64>>,
}

/// The order of the Gaussians: those of each group are together.
#[derive(Debug, Clone, Deserialize)]
struct Segments {
    persistent: [u64; 2],
    list: Vec<Segment>,
}

#[derive(Debug, Clone, Deserialize)]
struct Segment {
    range: [u64; 2],
}

/// The folders of the groups, if each has textures of its own.
#[derive(Debug, Clone, Deserialize)]
struct Streams {
    persistent: Option<String>,
    segments: Vec<Option<String>>,
}

/// How the textures of a group are read.
struct Reading {
    layout: Layout,
    centroids: Centroids,
    motion: Wide,
    accel: Option<Wide>,
    mean_t: Table,
    sigma_t: Table,
    trbf: String,
}

/// Gaussians of a group, and the factors of the square of time of their paths if there are any.
#[derive(Debug)]
struct Group {
    columns: Columns,
    accel: Vec<[f32; 3]>,
}

/// Reads a scene.
///
/// # Errors
/// Another version; groups that do not fit; a file that is missing or damaged; invalid options.
pub(super) fn read(files: &mut Files, meta: &Value, options: &ReadOptions) -> Result<Imported, ImportError> {
    let meta::Kind { version, .. } = meta::part("meta.json", meta)?;
    if version != Some(1) {
        let version = version.map_or("no version".to_owned(), |version| format!("version {version}"));
        return Err(ImportError::unsupported(format!("a .sogst of {version}, and only version 1 is known")));
    }
    let images: Images = meta::part("meta.json", meta)?;
    let count = images.count;
    let layout = Layout::of_images(images)?;
    let Fields { time, motion, accel, trbf, cov2d_scale, segments, streams } = meta::part("meta.json", meta)?;
    let groups = groups(count, segments.as_ref(), streams.as_ref())?;
    let accel = match (motion.degree, accel) {
        (1, _) => None,
        (2, Some(accel)) => Some(accel),
        (2, None) => return Err(ImportError::damaged("its meta.json has motion of degree 2 without accel")),
        (degree, _) => {
            return Err(ImportError::unsupported(format!(
                "a .sogst with motion of degree {degree}, and only 1 and 2 are known"
            )));
        }
    };
    let reading = Reading {
        centroids: layout.centroids(files)?,
        layout,
        motion: motion.wide,
        accel,
        mean_t: Table::of_codebook("trbf centers", &trbf.center.codebook)?,
        sigma_t: Table::of_codebook("trbf sigmas", &trbf.sigma.codebook)?,
        trbf: trbf.files.concat(),
    };
    let Group { columns, accel } = reading.all(files, count, &groups)?;
    let played = played(&time)?;
    let mut lost: Vec<String> = invisible(count as usize - columns.len(), count as usize).into_iter().collect();
    let columns = if accel.is_empty() { columns } else { straight(&columns, &accel, &played, options, &mut lost)? };
    let mut scene = columns.into_scene(played, options)?;
    if let Some([x, y]) = cov2d_scale.filter(|&scale| scale != [1.0, 1.0]) {
        // The factors are those of the field-of-view sentinel for one camera.
        scene.trained_with.cameras = options.cameras.unwrap_or(TrainedCameras::Intrinsics);
        scene.trained_with.raster_fov = options.raster_fov.unwrap_or(RasterFov::Reference);
        lost.push(format!(
            "Its footprints are {x} × {y} times as large as those of its Gaussians, as in training with intrinsics cameras; \
             they are drawn as for such cameras."
        ));
    }
    Ok(Imported { scene, lost })
}

/// Returns how the capture is played.
fn played(time: &Time) -> Result<Played, ImportError> {
    let time_interval = [time.min as f32, time.max as f32];
    if !(time_interval.iter().all(|time| time.is_finite()) && time_interval[0] < time_interval[1]) {
        let Time { min, max } = time;
        return Err(ImportError::damaged(format!("its meta.json has times from {min} to {max}, which is no interval")));
    }
    Ok(Played {
        up: UP,
        time_interval,
        duration_seconds: (time.max - time.min) as f32,
        marginal_cutoff: SMALLEST_CUTOFF,
    })
}

/// Returns the folder of each group, empty or with a slash at its end, and the number of its Gaussians.
///
/// # Errors
/// Groups that do not have all Gaussians, each once.
fn groups(
    count: u64,
    segments: Option<&Segments>,
    streams: Option<&Streams>,
) -> Result<Vec<(String, u64)>, ImportError> {
    let damaged = || ImportError::damaged("its meta.json has groups that do not have each Gaussian once");
    let Some(streams) = streams else { return Ok(vec![(String::new(), count)]) };
    let segments = segments.ok_or_else(damaged)?;
    if segments.list.len() != streams.segments.len() {
        return Err(damaged());
    }
    let ranges = [segments.persistent].into_iter().chain(segments.list.iter().map(|segment| segment.range));
    let names = [&streams.persistent].into_iter().chain(&streams.segments);
    let (mut groups, mut next) = (Vec::new(), 0);
    for ([first, last], name) in ranges.zip(names) {
        match name {
            _ if first == last => {}
            Some(name) if first == next && first < last => {
                groups.push((format!("{name}/"), last - first));
                next = last;
            }
            _ => return Err(damaged()),
        }
    }
    if next == count { Ok(groups) } else { Err(damaged()) }
}

impl Reading {
    /// Reads the Gaussians of all groups, in their order.
    fn all(&self, files: &mut Files, count: u64, groups: &[(String, u64)]) -> Result<Group, ImportError> {
        let of_group = |(folder, _): &(String, u64)| -> Vec<String> {
            self.names().map(|name| format!("{folder}{name}")).collect()
        };
        let names: Vec<Vec<String>> = groups.iter().map(of_group).collect();
        files.announce(names.iter().flatten().map(String::as_str))?;
        let encoded: Result<Vec<Vec<Encoded>>, ImportError> =
            names.iter().map(|names| textures::read(files, names.iter().map(String::as_str))).collect();
        let encoded = encoded?;
        textures::check_count(count, encoded.iter().flatten())?;
        let decoded: Vec<_> =
            encoded.par_iter().zip(groups).map(|(encoded, &(_, own))| self.group(encoded, own as usize)).collect();
        drop(encoded);
        let mut all: Option<Group> = None;
        for group in decoded {
            let group = group?;
            match &mut all {
                None => all = Some(group),
                Some(all) => all.append(group),
            }
        }
        Ok(all.unwrap_or_else(|| Group { columns: Columns::with_capacity(0, 0), accel: Vec::new() }))
    }

    /// Returns the names of the textures of a group.
    fn names(&self) -> impl Iterator<Item = &str> {
        let accel = self.accel.iter().flat_map(|accel| &accel.files);
        let others = self.motion.files.iter().chain([&self.trbf]).chain(accel);
        self.layout.names().chain(others.map(String::as_str))
    }

    fn group(&self, encoded: &[Encoded], count: usize) -> Result<Group, ImportError> {
        let decoded = textures::decode(encoded, count)?;
        let (attributes, others) = decoded.split_at(self.layout.names().count());
        let [low, high, trbf, curves @ ..] = others else {
            return Err(ImportError::damaged("its textures of motion are missing"));
        };
        let kept = splats::visible(attributes, 0..count);
        let mut columns = self.layout.columns(attributes, &self.centroids, &kept)?;
        let motion = |&i: &u32| {
            let [center, sigma, ..] = trbf.at(i);
            let velocity = self.motion.signed_log(low.at(i), high.at(i));
            Motion { velocity, mean_t: self.mean_t.at(center), sigma_t: self.sigma_t.at(sigma) }
        };
        columns.motion = kept.par_iter().map(motion).collect();
        let times: Vec<f32> = columns.motion.iter().flat_map(|motion| [motion.mean_t, motion.sigma_t]).collect();
        check_codes("trbf", &times)?;
        let accel = match (&self.accel, curves) {
            (Some(accel), [low, high]) => kept.par_iter().map(|&i| accel.signed_log(low.at(i), high.at(i))).collect(),
            _ => Vec::new(),
        };
        Ok(Group { columns, accel })
    }
}

impl Group {
    fn append(&mut self, other: Self) {
        let Columns { mean, log_scale, rotation, opacity_logit, harmonics, motion, .. } = other.columns;
        let own = &mut self.columns;
        own.mean.extend(mean);
        own.log_scale.extend(log_scale);
        own.rotation.extend(rotation);
        own.opacity_logit.extend(opacity_logit);
        own.motion.extend(motion);
        let Harmonics { values, .. } = harmonics;
        own.harmonics.values.extend(values);
        self.accel.extend(other.accel);
    }
}

/// Returns straight pieces of the paths `mean + velocity d + accel d²`, with d the time since the temporal mean.
fn straight(
    columns: &Columns,
    accel: &[[f32; 3]],
    played: &Played,
    options: &ReadOptions,
    lost: &mut Vec<String>,
) -> Result<Columns, ImportError> {
    let splitting = splitting(played, options, MAX_SEGMENTS, Bends::Smoothly)?;
    let sigma_t: Vec<f32> = columns.motion.iter().map(|motion| motion.sigma_t).collect();
    if !sigma_t.iter().all(|&sigma_t| sigma_t > 0.0) {
        return Err(ImportError::damaged("a temporal deviation is not positive"));
    }
    let pieces = splitting.split(columns.len(), |index| {
        let Motion { velocity, mean_t, sigma_t } = columns.motion[index];
        let [mean, velocity, accel] =
            [columns.mean[index], velocity, accel[index]].map(|v| DVec3::from(v.map(f64::from)));
        let position = move |time: f64| {
            let since = time - f64::from(mean_t);
            mean + (velocity + accel * since) * since
        };
        Curve { position, mean_t, sigma_t, window: ALWAYS, scale: middle_scale(columns.log_scale[index]) }
    });
    lost.extend(statements(&pieces, columns.len(), splitting.tolerance));
    Ok(in_pieces(columns, &sigma_t, pieces, |piece| columns.rotation[piece.source as usize]))
}
