//! A server of one file, with faults.
//!
//! In: the bytes of a file, whether parts of it are sent, and which requests fail. Out: an address; what has been asked
//! for.

use crate::support::byte_range::{parse_range, part_of};
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

/// How the server answers.
#[derive(Debug, Clone, Copy, Default)]
pub struct Answers {
    /// Whether it sends all of the file whatever part is asked for.
    pub no_parts: bool,
    /// Of so many requests of parts, the last fails, and so on; 0: none fails.
    pub fail_every: usize,
}

/// A request: the first byte and the byte after the last of a part; `None`: all of the file.
pub type Asked = Option<(usize, usize)>;

/// A server that runs until the process ends.
pub struct RangeServer {
    /// Without a scheme: `127.0.0.1:8080/take.gs4d`.
    pub address: String,
    asked: Arc<Mutex<Vec<Asked>>>,
}

impl RangeServer {
    pub fn new(file: Vec<u8>, answers: Answers) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = format!("{}/take.gs4d", listener.local_addr().expect("an address"));
        let asked = Arc::<Mutex<Vec<Asked>>>::default();
        let (own, file) = (asked.clone(), Arc::new(file));
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (own, file) = (own.clone(), file.clone());
                // A client may end a connection early.
                thread::spawn(move || answer(stream, &file, answers, &own));
            }
        });
        Self { address, asked }
    }

    /// Returns all requests of the file until now.
    pub fn asked(&self) -> Vec<Asked> {
        locked(&self.asked).clone()
    }
}

fn locked(asked: &Mutex<Vec<Asked>>) -> MutexGuard<'_, Vec<Asked>> {
    asked.lock().unwrap_or_else(PoisonError::into_inner)
}

fn answer(stream: TcpStream, file: &[u8], answers: Answers, asked: &Mutex<Vec<Asked>>) -> Option<()> {
    let mut reader = BufReader::new(stream);
    let (mut line, mut range) = (String::new(), None);
    reader.read_line(&mut line).ok()?;
    let path = line.split_whitespace().nth(1)?.to_owned();
    loop {
        let mut header = String::new();
        reader.read_line(&mut header).ok()?;
        let Some((name, value)) = header.split_once(':') else { break };
        if name.eq_ignore_ascii_case("range") {
            range = Some(parse_range(value, file.len())?);
        }
    }
    let stream = reader.get_mut();
    if path != "/take.gs4d" {
        return send(stream, "404 Not Found", b"");
    }
    let parts = {
        let mut asked = locked(asked);
        asked.push(range);
        asked.iter().flatten().count()
    };
    match range {
        Some(_) if answers.fail_every > 0 && parts.is_multiple_of(answers.fail_every) => {
            send(stream, "503 Service Unavailable", b"")
        }
        Some(range) if !answers.no_parts => {
            let (status, part) = part_of(file, range);
            send(stream, &status, part)
        }
        _ => send(stream, "200 OK", file),
    }
}

fn send(stream: &mut TcpStream, status: &str, body: &[u8]) -> Option<()> {
    let length = body.len();
    let head = format!("HTTP/1.1 {status}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    stream.write_all(head.as_bytes()).ok()?;
    stream.write_all(body).ok()
}
