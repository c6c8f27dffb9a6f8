//! `gs4d socket SCENE --name NAME --at X,Y,Z --time T -o OUT`: places a named point that follows a part of a capture.
//!
//! In: a capture, a point in it at a time. Out: a package with the track of the point; a report of its error, and of the
//! times at which it is lost. Also lists and removes sockets, and compares points with their known tracks.

use crate::cli::args::{CheckpointArgs, file_size, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes, lines};
use crate::offline::sockets::{Compared, Comparison, Followed, KnownPoint, Placement, compare, follow};
use crate::offline::store::outputs::Files;
use crate::offline::work::{save, write_settings};
use crate::scene::{GaussianScene, Socket};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Place a named point that follows what it is placed on, so that a game can attach props and effects to it.
///
/// The point moves with the Gaussians around it, forward and backward from its time, also where some end and others
/// begin. A socket of the same name is replaced. Without OUT it is only followed and reported.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d socket dancer.gs4d --name hand --at 0.31,-0.05,1.2 --time 0.5 -o with-hand.gs4d
  gs4d socket dancer.gs4d --name hand --at 0.31,-0.05,1.2 --time 0.5 --json
  gs4d socket with-hand.gs4d --list
  gs4d socket with-hand.gs4d --name hand --remove -o dancer.gs4d
  gs4d socket island.gs4d --points dataset/points.json

Positions are in capture units, times are timestamps: gs4d info shows the bounds and the time interval. In Bevy, a child
CaptureSocket::new(\"hand\") of the capture has the transform of the socket.")]
pub(crate) struct SocketVerb {
    /// The package, or a capture of any other format. It stays as it is.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The name of the socket.
    #[arg(long, value_name = "NAME", required_unless_present_any = ["list", "points"])]
    name: Option<String>,
    /// The position, capture space: on or in the part to follow.
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true)]
    #[arg(required_unless_present_any = ["list", "remove", "points"])]
    at: Option<[f32; 3]>,
    /// The time at which the position is meant, a timestamp of the capture.
    #[arg(long, value_name = "T", value_parser = values::number, allow_hyphen_values = true)]
    #[arg(required_unless_present_any = ["list", "remove", "points"])]
    time: Option<f32>,
    /// Samples of the track a second at speed 1 [default: 60].
    #[arg(long, value_name = "HZ", value_parser = values::positive)]
    rate: Option<f32>,
    /// The package to write (.gs4d). An existing file is replaced when the new one is complete.
    #[arg(short, long, value_name = "OUT")]
    out: Option<PathBuf>,
    /// Remove the socket instead.
    #[arg(long, requires = "out", conflicts_with_all = ["at", "time", "rate"])]
    remove: bool,
    /// List the sockets of SCENE instead.
    #[arg(long, conflicts_with_all = ["name", "at", "time", "rate", "out", "remove"])]
    list: bool,
    /// Compare sockets with the known tracks of the points in this file instead: the points.json of the film that SCENE
    /// was trained on. Each is placed where the point is in the middle of the times at which it is known. Nothing is
    /// written.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["name", "at", "time", "out", "remove", "list"])]
    points: Option<PathBuf>,
}

/// Samples of a track a second, unless another number is given: a frame of most displays.
const RATE: f32 = 60.0;

impl SocketVerb {
    /// Places, removes, lists or compares sockets.
    ///
    /// # Errors
    /// A capture or known points that cannot be read, a point that cannot be followed, no socket of the name to remove,
    /// a package that cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let files = Files::default().reads_scene(&self.scene);
        self.out.iter().fold(files, |files, out| files.writes(out, "gs4d")).check()?;
        let mut scene = CheckpointArgs::default().load(&self.scene)?;
        if let Some(file) = &self.points {
            return self.compare(&scene, file);
        }
        let followed = match (&self.name, self.at, self.time) {
            (Some(name), Some(position), Some(time)) => {
                let others = scene.sockets.iter().filter(|socket| socket.name != *name);
                let taken = others.map(|socket| socket.samples.len()).sum();
                let samples = self.samples(scene.playback.duration_seconds, taken)?;
                let placement = Placement { name: name.clone(), position, time, samples };
                let followed = follow(&scene, &placement, &mut Bars::default());
                let followed = followed.map_err(|error| Failure::at(&self.scene, &error))?;
                place(&mut scene.sockets, &followed.socket);
                Some(followed)
            }
            (Some(name), ..) => {
                self.remove(&mut scene.sockets, name)?;
                None
            }
            (None, ..) => None,
        };
        let size = self.save(&scene)?;
        Ok(self.report(&scene.sockets, followed.as_ref(), size))
    }

    /// Compares sockets with the known tracks of the points in a file.
    fn compare(&self, scene: &GaussianScene, file: &Path) -> Result<Report, Failure> {
        let known = KnownPoint::read(file, &scene.trained_with.origin)?;
        let samples = self.samples(scene.playback.duration_seconds, 0)?;
        let compared = compare(scene, &known, samples, &mut Bars::default());
        let Comparison { size, points } = compared.map_err(|error| Failure::at(&self.scene, &error))?;
        let mut table = Table::new(&["point", "from", "to", "largest", "mean", "lost", "way back"]);
        let percent = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2} %"));
        for point in &points {
            let Compared { name, interval: [from, to], .. } = point;
            let cells = percentages(point, size).map(percent);
            table.row([name.clone(), from.to_string(), to.to_string()].into_iter().chain(cells));
        }
        let of = |point: &Compared| {
            let Compared { name, time, interval: [from, to], places, .. } = point;
            let [largest, mean, lost, way_back] = percentages(point, size);
            json!({
                "name": name,
                "time": time,
                "from": from,
                "to": to,
                "places": places,
                "largest_percent": largest,
                "mean_percent": mean,
                "lost_percent": lost,
                "way_back_percent": way_back,
            })
        };
        let json = json!({
            "scene": self.scene.display().to_string(),
            "points": file.display().to_string(),
            "size": size,
            "compared": points.iter().map(of).collect::<Vec<_>>(),
        });
        let of_size = format!("{size:.3} units: distances are parts of it");
        Ok(Report::new(json, format!("{table}{}", lines(&[("size", of_size)]))))
    }

    /// Returns the number of samples over a capture that plays for `seconds`, in which other sockets have taken some;
    /// over a still as over one second.
    fn samples(&self, seconds: f32, taken: usize) -> Result<usize, Failure> {
        let seconds = if seconds > 0.0 { f64::from(seconds) } else { 1.0 };
        let rate = self.rate.unwrap_or(RATE);
        let count = (seconds * f64::from(rate)).ceil() + 1.0;
        let left = Socket::MOST_SAMPLES.saturating_sub(taken + 1);
        if count > left as f64 {
            let many = match taken {
                0 => format!("{count} samples are more than the {left} of a capture"),
                _ => format!("{count} samples are more than the {left} that its other sockets leave"),
            };
            return Err(Failure::about(&self.scene, &format!("--rate {rate}: {many}: give a lower one")));
        }
        Ok((count as usize).max(2))
    }

    /// Removes the socket of this name.
    fn remove(&self, sockets: &mut Vec<Socket>, name: &str) -> Result<(), Failure> {
        let count = sockets.len();
        sockets.retain(|socket| socket.name != name);
        if sockets.len() < count {
            return Ok(());
        }
        let known: Vec<&str> = sockets.iter().map(|socket| socket.name.as_str()).collect();
        let known = if known.is_empty() { "it has none".to_owned() } else { format!("it has {}", known.join(", ")) };
        Err(Failure::about(&self.scene, &format!("has no socket {name}: {known}")))
    }

    /// Writes the capture, if a package is to be written. Returns its size in bytes.
    fn save(&self, scene: &GaussianScene) -> Result<Option<u64>, Failure> {
        let Some(out) = &self.out else { return Ok(None) };
        save(out, scene, &write_settings(&scene.form, None))?;
        file_size(out).map(Some)
    }

    fn report(&self, sockets: &[Socket], followed: Option<&Followed>, size: Option<u64>) -> Report {
        let mut text = match followed {
            Some(followed) => facts(followed),
            None if sockets.is_empty() => "no sockets\n".to_owned(),
            None => table(sockets),
        };
        match (&self.out, size) {
            (Some(out), Some(size)) => text += &lines(&[("wrote", format!("{}, {}", out.display(), bytes(size)))]),
            _ if !self.list => text += &lines(&[("wrote", "nothing: --out names a package to store it in".to_owned())]),
            _ => {}
        }
        let json = json!({
            "scene": self.scene.display().to_string(),
            "out": self.out.as_ref().map(|out| out.display().to_string()),
            "bytes_out": size,
            "followed": followed.map(followed_json),
            "sockets": sockets.iter().map(socket_json).collect::<Vec<_>>(),
        });
        Report::new(json, text)
    }
}

/// Adds a socket, in place of the one of the same name.
fn place(sockets: &mut Vec<Socket>, socket: &Socket) {
    match sockets.iter_mut().find(|other| other.name == socket.name) {
        Some(other) => other.clone_from(socket),
        None => sockets.push(socket.clone()),
    }
}

/// Returns what is known of a socket that has been followed, for people.
fn facts(followed: &Followed) -> String {
    let Followed { socket, lost: [before, after], returns, size } = followed;
    let [from, to] = socket.reach().unwrap_or_default();
    let share = |distance: f32| format!("{distance:.4} units, {:.2} % of the size {size:.3}", 100.0 * distance / size);
    let mut pairs = vec![
        ("socket", socket.name.clone()),
        ("track", format!("{from} to {to}, {} samples", socket.samples.len())),
        ("error", share(largest_error(socket))),
    ];
    if let Some(back) = returns.iter().flatten().copied().reduce(f32::max) {
        pairs.push(("way back", share(back)));
    }
    pairs.extend(before.map(|time| ("lost", format!("before {time}"))));
    pairs.extend(after.map(|time| ("lost", format!("after {time}"))));
    lines(&pairs)
}

fn followed_json(followed: &Followed) -> Value {
    let Followed { socket, lost: [before, after], returns: [back_before, back_after], size } = followed;
    json!({
        "socket": socket_json(socket),
        "size": size,
        "lost_before": before,
        "lost_after": after,
        "return_of_before": back_before,
        "return_of_after": back_after,
    })
}

/// Returns the largest and the mean distance of a point from its known track in percent of the size of the capture, the
/// share of the known places at which it is lost, and by how much the way back misses the start, both in percent, too.
fn percentages(point: &Compared, size: f32) -> [Option<f64>; 4] {
    let of_size = |distance: Option<f32>| distance.map(|distance| 100.0 * f64::from(distance) / f64::from(size));
    [of_size(point.largest), of_size(point.mean), Some(100.0 * point.lost()), of_size(point.way_back)]
}

/// Returns a table of sockets.
fn table(sockets: &[Socket]) -> String {
    let mut table = Table::new(&["socket", "from", "to", "samples", "error"]);
    for socket in sockets {
        let [from, to] = socket.reach().unwrap_or_default();
        let (count, error) = (socket.samples.len().to_string(), format!("{:.4}", largest_error(socket)));
        table.row([socket.name.clone(), from.to_string(), to.to_string(), count, error]);
    }
    table.to_string()
}

/// Returns a socket without its samples, for programs.
fn socket_json(socket: &Socket) -> Value {
    let [from, to] = socket.reach().unwrap_or_default();
    let error = largest_error(socket);
    json!({ "name": socket.name, "from": from, "to": to, "samples": socket.samples.len(), "error": error })
}

/// Returns the largest estimate of the error over a track, capture units.
fn largest_error(socket: &Socket) -> f32 {
    socket.samples.iter().map(|sample| sample.error).fold(0.0, f32::max)
}
