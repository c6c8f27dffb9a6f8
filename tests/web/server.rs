//! The server of the pages.
//!
//! In: the folder of the built page, the pictures that are wanted, captures, a function that opens an address in a browser.
//! Out: what the page has posted, by name, once it has posted `end`; a message if it fails.
//!
//! `/parts.gs4d` is the index and all chunk files in one file, of which parts are sent; `/whole.gs4d` is the same without parts.
//! The chunk files are in four folders: `/take/`, where all is well; `/slow/`, whose files of layer 1 are answered once
//! `/slow/finer` has been asked for, and that of the last stretch once `/slow/last` has; `/flaky/`, where the first request of each chunk file fails; `/lossy/`, which lacks the
//! first chunk file.

use crate::browser::Browser;
use crate::shots::{Shot, listed};
use crate::support::byte_range::{parse_range, part_of};
use crate::take::Take;
use bevy_gs4d::scene::ChunkTable;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// What a page has posted, by name.
pub type Results = BTreeMap<String, Vec<u8>>;

/// Longest time for all that the page does: minutes on a busy machine without a GPU.
const LIMIT: Duration = Duration::from_secs(240);

/// Longest body that is accepted, bytes.
const LONGEST: usize = 1 << 24;

/// Captures that pages open.
pub struct Captures {
    pub large: Vec<u8>,
    pub take: Take,
}

/// Serves the pages until they are done.
pub fn serve(
    folder: &Path,
    shots: &[Shot],
    Captures { large, take }: Captures,
    open: impl FnOnce(&str) -> Browser,
) -> Result<Results, String> {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("http://{}/test/page.html", listener.local_addr().expect("an address"));
    let (to, posted) = channel();
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    files.insert("/test/page.html".into(), b"<!doctype html><script type=module src=page.js></script>".to_vec());
    files.insert("/test/page.js".into(), include_bytes!("page.js").to_vec());
    files.insert("/test/hooks.js".into(), include_bytes!("hooks.js").to_vec());
    files.insert("/test/shots.json".into(), listed(shots).into_bytes());
    files.insert("/large.gs4d".into(), large);
    let names: Vec<&str> = take.files.keys().map(String::as_str).collect();
    files.insert("/test/take.json".into(), serde_json::Value::from(names).to_string().into_bytes());
    for shot in shots {
        if let Some(package) = &shot.package {
            files.insert(shot.file.clone(), package.clone());
        }
    }
    let of = take.files.len() - 1;
    for (name, bytes) in &take.files {
        for folder in ["take", "slow", "flaky", "lossy"] {
            if (folder, name) != ("lossy", &ChunkTable::file_name(0, of)) {
                files.insert(format!("/{folder}/{name}"), bytes.clone());
            }
        }
    }
    let mut late = BTreeMap::new();
    for (until, names) in [("/slow/finer", &take.finer), ("/slow/last", &take.last)] {
        files.insert(until.into(), Vec::new());
        late.extend(names.iter().map(|name| (format!("/slow/{name}"), until)));
    }
    for name in ["/parts.gs4d", "/whole.gs4d"] {
        files.insert(name.into(), take.one.clone());
    }
    let (files, folder) = (Arc::new(files), folder.to_owned());
    let faults = Arc::new(Faults { late, asked: Mutex::default() });
    // The thread ends with the process of the tests.
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let (files, folder, faults, to) = (files.clone(), folder.clone(), faults.clone(), to.clone());
            thread::spawn(move || answer(stream, &files, &folder, &faults, &to));
        }
    });
    let browser = open(&address);
    let mut results = Results::new();
    loop {
        match posted.recv_timeout(LIMIT) {
            Ok((name, _)) if name == "end" => break,
            Ok((name, bytes)) => drop(results.insert(name, bytes)),
            Err(_) => {
                return Err(format!("the page reports nothing for {LIMIT:?}; it has reported {:?}", results.keys()));
            }
        }
    }
    drop(browser);
    match results.get("failure") {
        Some(failure) => Err(format!("{}; it has reported {:?}", String::from_utf8_lossy(failure), results.keys())),
        None => Ok(results),
    }
}

/// What is wrong with the server, for some paths.
struct Faults {
    /// Paths that wait until others have been asked for.
    late: BTreeMap<String, &'static str>,
    /// Paths that have been asked for.
    asked: Mutex<BTreeSet<String>>,
}

impl Faults {
    fn asked(&self) -> MutexGuard<'_, BTreeSet<String>> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a request. Returns whether it is the first of its path.
    fn ask(&self, path: &str) -> bool {
        self.asked().insert(path.to_owned())
    }

    /// Waits until a path may be answered.
    fn wait_for(&self, path: &str) {
        let (began, until) = (Instant::now(), self.late.get(path));
        while until.is_some_and(|until| !self.asked().contains(*until)) && began.elapsed() < LIMIT {
            thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Answers one request. A browser that ends a connection early is no fault.
fn answer(
    stream: TcpStream,
    files: &BTreeMap<String, Vec<u8>>,
    folder: &Path,
    faults: &Faults,
    to: &Sender<(String, Vec<u8>)>,
) -> Option<()> {
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let mut words = line.split_whitespace();
    let (method, path) = (words.next()?.to_owned(), words.next()?.split('?').next()?.to_owned());
    let (mut length, mut range) = (0, None);
    loop {
        let mut header = String::new();
        reader.read_line(&mut header).ok()?;
        if header.trim().is_empty() {
            break;
        }
        let Some((name, value)) = header.split_once(':') else { continue };
        match name.to_ascii_lowercase().as_str() {
            "content-length" => length = value.trim().parse().ok()?,
            "range" => range = Some(value.to_owned()),
            _ => {}
        }
    }
    let mut body = vec![0; LONGEST.min(length)];
    reader.read_exact(&mut body).ok()?;
    if method == "POST" {
        to.send((path.trim_start_matches("/result/").to_owned(), body)).ok()?;
        return write(reader.get_mut(), "204 No Content", "text/plain", b"");
    }
    if faults.ask(&path) && path.starts_with("/flaky/chunk-") {
        return write(reader.get_mut(), "503 Service Unavailable", "text/plain", b"");
    }
    faults.wait_for(&path);
    let file = files.get(&path).cloned().or_else(|| {
        let name = path.strip_prefix("/page/").filter(|name| !name.contains(".."))?;
        std::fs::read(folder.join(if name.is_empty() { "index.html" } else { name })).ok()
    });
    let Some(mut bytes) = file else { return write(reader.get_mut(), "404 Not Found", "text/plain", b"") };
    if path == "/page/index.html" {
        let text =
            String::from_utf8_lossy(&bytes).replacen("<head>", "<head><script src=\"/test/hooks.js\"></script>", 1);
        bytes = text.into_bytes();
    }
    let kind = match path.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript",
        Some("css") => "text/css",
        Some("wasm") => "application/wasm",
        Some("jpg") => "image/jpeg",
        _ => "application/octet-stream",
    };
    if let Some(range) = range.filter(|_| path == "/parts.gs4d") {
        let (status, part) = part_of(&bytes, parse_range(&range, bytes.len())?);
        return write(reader.get_mut(), &status, kind, part);
    }
    write(reader.get_mut(), "200 OK", kind, &bytes)
}

fn write(stream: &mut TcpStream, status: &str, kind: &str, body: &[u8]) -> Option<()> {
    let length = body.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    stream.write_all(head.as_bytes()).ok()?;
    stream.write_all(body).ok()
}
