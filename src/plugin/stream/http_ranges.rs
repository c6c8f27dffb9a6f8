//! Parts of files from servers: the asset sources `http` and `https`, read by byte ranges.
//!
//! In: addresses, positions in files. Out: a [`Reader`] for each file, which asks the server for the bytes that are
//! read, at first for 64 KiB. A file that is read to its end from its beginning is asked for whole. A server that
//! answers a range with all of the file gives no parts: then the reader does not seek, and has all bytes.

use super::http_request::{Client, Request, Response};
use crate::plugin::asset::PartSources;
use async_channel::Receiver;
use bevy::app::{App, Plugin};
use bevy::asset::io::{
    AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader, ReaderNotSeekableError, STACK_FUTURE_SIZE,
    SeekableReader, StackFuture, VecReader,
};
use bevy::asset::{AssetApp, AssetPlugin};
use bevy::log::warn;
use bevy::tasks::futures_lite::{AsyncRead, AsyncSeek, Stream};
use std::io::{Error, ErrorKind, SeekFrom};
use std::path::Path;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

/// Bytes that the first request of a file asks for: enough for the index of a capture of a minute.
const FIRST: u64 = 1 << 16;

/// Loads assets from servers, of captures in one file only the parts that are played: the asset sources `http` and
/// `https`. Add it before Bevy's `AssetPlugin`, which `DefaultPlugins` has, and leave Bevy's features `http` and
/// `https` off, whose sources read files whole and would replace these.
///
/// ```no_run
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::stream::HttpRangesPlugin;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((GaussianCapture3d(assets.load("https://example.com/take.gs4d")), Upright));
/// }
///
/// App::new()
///     .add_plugins((HttpRangesPlugin, DefaultPlugins, GaussianCapturePlugins))
///     .add_systems(Startup, setup)
///     .run();
/// ```
///
/// In a browser, a server on another origin must allow the page to read (`Access-Control-Allow-Origin`).
#[derive(Debug, Default, Clone, Copy)]
pub struct HttpRangesPlugin;

impl Plugin for HttpRangesPlugin {
    fn build(&self, app: &mut App) {
        if app.is_plugin_added::<AssetPlugin>() {
            warn!("HttpRangesPlugin has no effect after AssetPlugin: add it before DefaultPlugins");
            return;
        }
        app.init_resource::<PartSources>();
        let (sources, client) = (app.world().resource::<PartSources>().clone(), Client::default());
        for scheme in ["http", "https"] {
            let own = Server { scheme, sources: sources.clone(), client: client.clone() };
            let processed = own.clone();
            let builder = AssetSourceBuilder::new(move || Box::new(own.clone()))
                .with_processed_reader(move || Box::new(processed.clone()));
            app.register_asset_source(scheme, builder);
        }
    }
}

/// The files of all servers of a scheme.
#[derive(Clone)]
struct Server {
    scheme: &'static str,
    sources: PartSources,
    client: Client,
}

impl Server {
    /// Returns a reader that has not asked for anything yet.
    fn reader(&self, path: &Path) -> RangeReader {
        // Paths of assets are separated by the separators of the system.
        let path = path.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/");
        RangeReader::new(self.client.clone(), format!("{}://{path}", self.scheme))
    }
}

impl AssetReader for Server {
    /// A file that is not there is told when it is read.
    async fn read<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        self.sources.note(self.scheme);
        Ok(self.reader(path))
    }

    async fn read_meta<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        let mut meta = path.as_os_str().to_owned();
        meta.push(".meta");
        // A query, such as a signature, is that of the file alone.
        if path.to_string_lossy().contains('?') {
            return Err(AssetReaderError::NotFound(meta.into()));
        }
        let mut bytes = Vec::new();
        let read = self.reader(Path::new(&meta)).read_to_end(&mut bytes).await;
        match read {
            Ok(_) => Ok(VecReader::new(bytes)),
            // Buckets forbid what is not there.
            Err(error) if [ErrorKind::NotFound, ErrorKind::PermissionDenied].contains(&error.kind()) => {
                Err(AssetReaderError::NotFound(meta.into()))
            }
            Err(error) => Err(AssetReaderError::Io(error.into())),
        }
    }

    async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
        Err(AssetReaderError::NotFound(path.to_owned()))
    }

    async fn is_directory<'a>(&'a self, _path: &'a Path) -> Result<bool, AssetReaderError> {
        Ok(false)
    }
}

/// Bytes of a file that a server has sent.
struct Answer {
    /// Where they are in the file.
    start: u64,
    bytes: Vec<u8>,
    /// The length of the file, if it is known.
    length: Option<u64>,
    /// Whether they are all of the file although a part was asked for.
    is_whole: bool,
}

/// A file of a server.
struct RangeReader {
    client: Client,
    url: String,
    position: u64,
    /// The last answer.
    held: Answer,
    /// The answer that is on its way.
    asked: Option<Pin<Box<Receiver<Result<Answer, Error>>>>>,
}

impl RangeReader {
    fn new(client: Client, url: String) -> Self {
        let held = Answer { start: 0, bytes: Vec::new(), length: None, is_whole: false };
        Self { client, url, position: 0, held, asked: None }
    }

    /// Returns the bytes from the position on that have been received.
    fn at_hand(&self) -> &[u8] {
        let offset = self.position.checked_sub(self.held.start).and_then(|offset| usize::try_from(offset).ok());
        offset.and_then(|offset| self.held.bytes.get(offset..)).unwrap_or_default()
    }

    fn has_ended(&self) -> bool {
        self.held.length.is_some_and(|length| self.position >= length)
    }

    /// Makes bytes at the position at hand, unless the file ends there: `count` of them, or all up to the end of the
    /// file.
    fn poll_at_hand(&mut self, context: &mut Context<'_>, count: Option<u64>) -> Poll<Result<(), Error>> {
        while self.at_hand().is_empty() && !self.has_ended() {
            let (client, url, position) = (&self.client, &self.url, self.position);
            let asked = self.asked.get_or_insert_with(|| Box::pin(ask(client, url, position, count)));
            let answer = ready!(asked.as_mut().poll_next(context));
            self.asked = None;
            self.held = answer.unwrap_or_else(|| Err(Error::other("the request was given up")))?;
        }
        Poll::Ready(Ok(()))
    }
}

/// Asks a server for bytes of a file from a position on: for `count` bytes, or all up to the end of the file.
fn ask(client: &Client, url: &str, position: u64, count: Option<u64>) -> Receiver<Result<Answer, Error>> {
    let (sender, receiver) = async_channel::bounded(1);
    client.fetch(Request { url: url.to_owned(), position, count }, move |response| {
        // The reader may be gone.
        let _ = sender.try_send(response.and_then(|response| answer(response, position, count)));
    });
    receiver
}

/// Returns what a server has sent in answer to a request of bytes from a position on: of `count`, or all to the end.
fn answer(response: Response, position: u64, count: Option<u64>) -> Result<Answer, Error> {
    let received = response.bytes.len() as u64;
    match response.status {
        200 if position > 0 => Err(Error::other("the server sends no parts of the file any more")),
        200 => Ok(Answer { start: 0, bytes: response.bytes, length: Some(received), is_whole: count.is_some() }),
        206 => {
            let (start, length) = match response.content_range.as_deref().map(content_range) {
                Some(Some((start, length))) => (start, length),
                Some(None) => return Err(Error::other("the server has sent a part that it does not describe")),
                // Browsers show the header of another origin to no page that the server does not list.
                None => {
                    let is_end = count.is_none_or(|count| received < count);
                    (position, is_end.then(|| position.saturating_add(received)))
                }
            };
            if start != position || received == 0 {
                return Err(Error::other("the server has sent another part than was asked for"));
            }
            Ok(Answer { start, bytes: response.bytes, length, is_whole: false })
        }
        // The file ends before the position.
        416 => Ok(Answer { start: position, bytes: Vec::new(), length: Some(position), is_whole: false }),
        401 | 403 => {
            let fault = format!("the server answered {} {}", response.status, response.status_text);
            Err(Error::new(ErrorKind::PermissionDenied, fault))
        }
        404 | 410 => Err(Error::new(ErrorKind::NotFound, "the server has no such file")),
        status => Err(Error::other(format!("the server answered {status} {}", response.status_text))),
    }
}

/// Returns where a part begins and the length of the file, if it is known, of the header `Content-Range: bytes
/// 0-99/1000`.
fn content_range(value: &str) -> Option<(u64, Option<u64>)> {
    let (range, length) = value.trim().strip_prefix("bytes")?.trim_start().split_once('/')?;
    let (first, _) = range.split_once('-')?;
    Some((first.trim().parse().ok()?, length.trim().parse().ok()))
}

impl AsyncRead for RangeReader {
    fn poll_read(self: Pin<&mut Self>, context: &mut Context<'_>, buffer: &mut [u8]) -> Poll<Result<usize, Error>> {
        let own = self.get_mut();
        if buffer.is_empty() {
            return Poll::Ready(Ok(0));
        }
        let count = buffer.len() as u64;
        let count = if own.position == 0 { count.max(FIRST) } else { count };
        ready!(own.poll_at_hand(context, Some(count)))?;
        let at_hand = own.at_hand();
        let count = at_hand.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(at_hand) {
            *to = *from;
        }
        own.position += count as u64;
        Poll::Ready(Ok(count))
    }
}

impl AsyncSeek for RangeReader {
    fn poll_seek(self: Pin<&mut Self>, _context: &mut Context<'_>, to: SeekFrom) -> Poll<Result<u64, Error>> {
        let own = self.get_mut();
        let position = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::Current(by) => own.position.checked_add_signed(by),
            SeekFrom::End(by) => own.held.length.and_then(|length| length.checked_add_signed(by)),
        };
        let fault =
            || Error::new(ErrorKind::InvalidInput, "before the start of a file, or from an end that is not known");
        own.position = position.ok_or_else(fault)?;
        // An answer to another position is of no use.
        own.asked = None;
        Poll::Ready(Ok(own.position))
    }
}

impl Reader for RangeReader {
    fn read_to_end<'a>(
        &'a mut self,
        bytes: &'a mut Vec<u8>,
    ) -> StackFuture<'a, std::io::Result<usize>, STACK_FUTURE_SIZE> {
        StackFuture::from(async move {
            let before = bytes.len();
            loop {
                std::future::poll_fn(|context| self.poll_at_hand(context, None)).await?;
                let at_hand = self.at_hand();
                if at_hand.is_empty() {
                    return Ok(bytes.len() - before);
                }
                bytes.extend_from_slice(at_hand);
                self.position += at_hand.len() as u64;
            }
        })
    }

    fn seekable(&mut self) -> Result<&mut dyn SeekableReader, ReaderNotSeekableError> {
        if self.held.is_whole { Err(ReaderNotSeekableError) } else { Ok(self) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response(status: u16, range: Option<&str>, bytes: &[u8]) -> Response {
        let content_range = range.map(str::to_owned);
        Response { status, status_text: "Said".to_owned(), content_range, bytes: bytes.to_vec() }
    }

    #[test]
    fn answers_are_parts_of_the_file_or_faults() {
        let three = Some(3);
        let part = answer(response(206, Some("bytes 5-7/100"), b"abc"), 5, three).expect("a part");
        assert_eq!((part.start, part.length, part.is_whole), (5, Some(100), false), "from the position on");
        let unknown = answer(response(206, Some("bytes 5-7/*"), b"abc"), 5, three).expect("a part");
        assert_eq!(unknown.length, None, "of a file of unknown length");
        let length = |count| answer(response(206, None, b"abc"), 5, count).expect("a part").length;
        assert_eq!([three, Some(4), None].map(length), [None, Some(8), Some(8)], "not described, to the end or before");
        let whole = answer(response(200, None, b"abc"), 0, three).expect("all of the file");
        assert_eq!((whole.start, whole.length, whole.is_whole), (0, Some(3), true), "in place of a part");
        assert!(!answer(response(200, None, b"abc"), 0, None).expect("all of the file").is_whole, "as was asked for");
        let end = answer(response(416, None, b"no"), 5, three).expect("the end");
        assert_eq!((end.bytes.len(), end.length), (0, Some(5)), "after the end");
        let fault = |given| answer(given, 5, three).err().expect("a fault");
        assert_eq!(fault(response(404, None, b"")).kind(), ErrorKind::NotFound, "no such file");
        assert_eq!(fault(response(403, None, b"")).kind(), ErrorKind::PermissionDenied, "forbidden");
        assert!(fault(response(503, None, b"")).to_string().contains("503 Said"), "as the server says");
        assert!(
            fault(response(200, None, b"abcdefgh")).to_string().contains("no parts"),
            "all in place of a later part"
        );
        for (range, bytes) in [("bytes 6-8/100", &b"abc"[..]), ("lines 5-7", b"abc"), ("bytes 5-7/100", b"")] {
            fault(response(206, Some(range), bytes));
        }
    }
}
