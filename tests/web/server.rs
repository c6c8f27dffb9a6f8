//! The server of the pages.
//!
//! In: the folder of the built page, the pictures that are wanted, a large capture, a function that opens an address in
//! a browser. Out: what the page has posted, by name, once it has posted `end`; a message if it fails.

use crate::browser::Browser;
use crate::shots::{Shot, listed};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

/// What a page has posted, by name.
pub type Results = BTreeMap<String, Vec<u8>>;

/// Longest time for all that the page does: minutes on a busy machine without a GPU.
const LIMIT: Duration = Duration::from_secs(240);

/// Longest body that is accepted, bytes.
const LONGEST: usize = 1 << 24;

/// Serves the pages until they are done.
pub fn serve(
    folder: &Path,
    shots: &[Shot],
    large: Vec<u8>,
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
    for shot in shots {
        if let Some(package) = &shot.package {
            files.insert(shot.file.clone(), package.clone());
        }
    }
    let (files, folder) = (Arc::new(files), folder.to_owned());
    // The thread ends with the process of the tests.
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let (files, folder, to) = (files.clone(), folder.clone(), to.clone());
            thread::spawn(move || answer(stream, &files, &folder, &to));
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

/// Answers one request. A browser that ends a connection early is no fault.
fn answer(
    stream: TcpStream,
    files: &BTreeMap<String, Vec<u8>>,
    folder: &Path,
    to: &Sender<(String, Vec<u8>)>,
) -> Option<()> {
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let mut words = line.split_whitespace();
    let (method, path) = (words.next()?.to_owned(), words.next()?.split('?').next()?.to_owned());
    let mut length = 0;
    loop {
        let mut header = String::new();
        reader.read_line(&mut header).ok()?;
        if header.trim().is_empty() {
            break;
        }
        if let Some((name, value)) = header.split_once(':')
            && name.eq_ignore_ascii_case("content-length")
        {
            length = value.trim().parse().ok()?;
        }
    }
    let mut body = vec![0; LONGEST.min(length)];
    reader.read_exact(&mut body).ok()?;
    if method == "POST" {
        to.send((path.trim_start_matches("/result/").to_owned(), body)).ok()?;
        return write(reader.get_mut(), "204 No Content", "text/plain", b"");
    }
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
    write(reader.get_mut(), "200 OK", kind, &bytes)
}

fn write(stream: &mut TcpStream, status: &str, kind: &str, body: &[u8]) -> Option<()> {
    let length = body.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    stream.write_all(head.as_bytes()).ok()?;
    stream.write_all(body).ok()
}
