//! A simulated link: an asset source whose files arrive with a delay and at a rate, or not at all.
//!
//! In: a folder, the quality of the link. Out: the asset source `link`, and what came over it. It is no network: bytes
//! come from the disk and are held back until they would have arrived. On request it stops for a while, or slows down.

use crate::figures::scattered;
use crate::timer::Timer;
use bevy::asset::AssetPath;
use bevy::asset::io::file::FileAssetReader;
use bevy::asset::io::{
    AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader, ReaderNotSeekableError, SeekableReader,
    VecReader,
};
use bevy::prelude::*;
use bevy::tasks::futures_lite::{AsyncRead, AsyncSeek};
use std::fmt;
use std::io::{Error, ErrorKind, SeekFrom};
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};

/// How good a link is. Default: as good as the disk.
#[derive(Debug, Default, Clone, Copy)]
pub struct Quality {
    /// Bits a second, for all requests together; `None`: no limit.
    pub rate: Option<f64>,
    /// Time from a request to its first byte.
    pub latency: Duration,
    /// The share of the requests that fail, 0 to 1.
    pub lost: f64,
    /// How long the link stops when it is [disturbed](Link::disturb).
    pub outage: Duration,
    /// Whether it has half the rate from then on.
    pub halves: bool,
}

impl Quality {
    /// Returns whether the link can be disturbed.
    pub fn is_disturbed(&self) -> bool {
        self.halves || !self.outage.is_zero()
    }
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.rate.is_none() && self.latency.is_zero() && self.lost == 0.0 {
            return f.write_str("no link: files come from the disk");
        }
        f.write_str("a simulated link: ")?;
        match self.rate {
            Some(rate) => write!(f, "{} Mbit/s", rate * 1e-6)?,
            None => f.write_str("any rate")?,
        }
        write!(f, ", {} ms to the first byte, {} % lost", self.latency.as_secs_f64() * 1e3, self.lost * 1e2)
    }
}

/// What has come over a link.
#[derive(Debug, Default, Clone, Copy)]
pub struct Traffic {
    /// When the last byte of all requests so far arrives.
    busy: Option<Instant>,
    /// Whether it has half the rate.
    is_halved: bool,
    pub requests: u64,
    /// Requests that failed on purpose.
    pub lost: u64,
    pub bytes: u64,
}

/// A link to the folder of a capture in chunk files: the plugin that adds the asset source, to be added before Bevy's
/// `AssetPlugin`. Clones share the link.
#[derive(Clone)]
pub struct Link {
    /// The index of the capture.
    index: PathBuf,
    quality: Quality,
    timer: Timer,
    traffic: Arc<Mutex<Traffic>>,
}

impl Link {
    /// Returns a link to the folder of an index.
    pub fn new(index: &Path, quality: Quality) -> Self {
        Self { index: index.into(), quality, timer: Timer::start(), traffic: Arc::default() }
    }

    /// Returns the asset path of the index.
    pub fn index(&self) -> AssetPath<'static> {
        AssetPath::from(PathBuf::from(self.index.file_name().unwrap_or_default())).with_source("link")
    }

    /// Returns what has come over the link.
    pub fn traffic(&self) -> Traffic {
        *self.lock()
    }

    /// Returns how good the link is.
    pub fn quality(&self) -> &Quality {
        &self.quality
    }

    /// Stops the link for a while, and slows it down, as far as its quality says so. Of each request, up to `TURN` bytes
    /// arrive before.
    pub fn disturb(&self) {
        let (mut traffic, now) = (self.lock(), Instant::now());
        traffic.busy = Some(traffic.busy.map_or(now, |busy| busy.max(now)) + self.quality.outage);
        traffic.is_halved = self.quality.halves;
    }

    fn lock(&self) -> MutexGuard<'_, Traffic> {
        self.traffic.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a request. Returns whether it fails; that for the index does not, since a game would ask again.
    fn ask(&self, is_index: bool) -> bool {
        let mut traffic = self.lock();
        traffic.requests += 1;
        let is_lost = !is_index && scattered(traffic.requests) < self.quality.lost;
        traffic.lost += u64::from(is_lost);
        is_lost
    }

    /// Returns when the last of the next bytes arrives of a request that was sent at `asked`: requests wait for their
    /// first byte side by side, and take turns.
    fn arrival(&self, asked: Instant, bytes: usize) -> Instant {
        let mut traffic = self.lock();
        let first = asked + self.quality.latency;
        let begin = traffic.busy.map_or(first, |busy| busy.max(first));
        let slower = if traffic.is_halved { 2.0 } else { 1.0 };
        let seconds = self.quality.rate.map_or(0.0, |rate| 8.0 * bytes as f64 * slower / rate);
        let last = begin + Duration::from_secs_f64(seconds);
        traffic.busy = Some(last);
        traffic.bytes += bytes as u64;
        last
    }
}

impl Plugin for Link {
    fn build(&self, app: &mut App) {
        let link = self.clone();
        let folder = self.index.parent().map(Path::to_path_buf).unwrap_or_default();
        let source = AssetSourceBuilder::new(move || {
            Box::new(LinkReader { files: FileAssetReader::new(&folder), link: link.clone() })
        });
        app.register_asset_source("link", source);
    }
}

/// Reads files over a link.
struct LinkReader {
    files: FileAssetReader,
    link: Link,
}

impl AssetReader for LinkReader {
    async fn read<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        let file: Box<dyn Reader + 'a> = Box::new(self.files.read(path).await?);
        let is_index = self.link.index.file_name() == Some(path.as_os_str());
        Ok(OverLink { file, link: &self.link, is_index, request: None, wait: None, arrived: Vec::new() })
    }

    /// There are no files of settings, so that nothing asks for them over the link.
    async fn read_meta<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        Err::<VecReader, _>(AssetReaderError::NotFound(path.into()))
    }

    async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
        self.files.read_directory(path).await
    }

    async fn is_directory<'a>(&'a self, path: &'a Path) -> Result<bool, AssetReaderError> {
        self.files.is_directory(path).await
    }
}

/// Most bytes that a request brings before it is the turn of others.
const TURN: usize = 64 << 10;

/// A file, or a part of it, on its way: the bytes that are read, from one position on, are one request.
struct OverLink<'a> {
    file: Box<dyn Reader + 'a>,
    link: &'a Link,
    /// Whether the file begins with the index, whose request is not lost, and the position has not changed.
    is_index: bool,
    /// When the request was sent, and whether it is lost.
    request: Option<(Instant, bool)>,
    /// Bytes that are on their way, and those that have arrived.
    wait: Option<Pin<Box<dyn Future<Output = ()> + Send + Sync + 'a>>>,
    arrived: Vec<u8>,
}

impl AsyncRead for OverLink<'_> {
    fn poll_read(self: Pin<&mut Self>, context: &mut Context<'_>, buffer: &mut [u8]) -> Poll<Result<usize, Error>> {
        let own = self.get_mut();
        let (link, is_index) = (own.link, own.is_index);
        let (asked, is_lost) = *own.request.get_or_insert_with(|| (Instant::now(), link.ask(is_index)));
        if own.wait.is_none() && own.arrived.is_empty() {
            let mut bytes = vec![0; buffer.len().min(TURN)];
            let count = ready!(Pin::new(&mut own.file).poll_read(context, &mut bytes))?;
            bytes.truncate(count);
            let arrival = if is_lost { asked + link.quality.latency } else { link.arrival(asked, count) };
            own.arrived = bytes;
            own.wait = Some(Box::pin(link.timer.wait_until(arrival)));
        }
        if let Some(wait) = &mut own.wait {
            ready!(wait.as_mut().poll(context));
            own.wait = None;
        }
        if is_lost {
            return Poll::Ready(Err(Error::new(ErrorKind::TimedOut, "the simulated link lost the request")));
        }
        let count = own.arrived.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(own.arrived.drain(..count)) {
            *to = from;
        }
        Poll::Ready(Ok(count))
    }
}

impl AsyncSeek for OverLink<'_> {
    /// Begins another request.
    fn poll_seek(self: Pin<&mut Self>, context: &mut Context<'_>, to: SeekFrom) -> Poll<Result<u64, Error>> {
        let own = self.get_mut();
        (own.is_index, own.request, own.wait) = (false, None, None);
        own.arrived.clear();
        match own.file.seekable() {
            Ok(file) => Pin::new(file).poll_seek(context, to),
            Err(error) => Poll::Ready(Err(Error::other(error))),
        }
    }
}

impl Reader for OverLink<'_> {
    fn seekable(&mut self) -> Result<&mut dyn SeekableReader, ReaderNotSeekableError> {
        Ok(self)
    }
}
