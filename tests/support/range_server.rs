//! A server of one file, with faults.
//!
//! In: the bytes of a file, whether parts of it are sent, and which requests fail; over TLS or not. Out: an address;
//! the certificate of the server; what has been asked for, through how many connections.

use crate::support::byte_range::{parse_range, part_of};
use rcgen::{CertifiedKey, generate_simple_self_signed};
use rustls::crypto::ring;
use rustls::pki_types::PrivateKeyDer;
use rustls::{ServerConfig, ServerConnection, StreamOwned};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
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
    seen: Arc<Mutex<Seen>>,
}

/// What a server has seen.
#[derive(Default)]
struct Seen {
    asked: Vec<Asked>,
    connections: usize,
}

impl RangeServer {
    /// Returns a server of `http`.
    pub fn new(file: Vec<u8>, answers: Answers) -> Self {
        Self::running(file, answers, None)
    }

    /// Returns a server of `https`, and its certificate, which it has signed itself, as PEM.
    pub fn over_tls(file: Vec<u8>, answers: Answers) -> (Self, String) {
        let CertifiedKey { cert, signing_key } =
            generate_simple_self_signed(["127.0.0.1".to_owned()]).expect("a certificate");
        let key = PrivateKeyDer::Pkcs8(signing_key.serialize_der().into());
        let config = ServerConfig::builder_with_provider(ring::default_provider().into())
            .with_safe_default_protocol_versions()
            .and_then(|config| config.with_no_client_auth().with_single_cert(vec![cert.der().clone()], key))
            .expect("a configuration");
        (Self::running(file, answers, Some(config.into())), cert.pem())
    }

    fn running(file: Vec<u8>, answers: Answers, tls: Option<Arc<ServerConfig>>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = format!("{}/take.gs4d", listener.local_addr().expect("an address"));
        let seen = Arc::<Mutex<Seen>>::default();
        let (own, file) = (seen.clone(), Arc::new(file));
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (own, file, tls) = (own.clone(), file.clone(), tls.clone());
                thread::spawn(move || match tls.map(ServerConnection::new) {
                    Some(connection) => {
                        answer_all(StreamOwned::new(connection.expect("a connection"), stream), &file, answers, &own);
                    }
                    None => answer_all(stream, &file, answers, &own),
                });
            }
        });
        Self { address, seen }
    }

    /// Returns all requests of the file until now.
    pub fn asked(&self) -> Vec<Asked> {
        locked(&self.seen).asked.clone()
    }

    /// Returns the number of connections through which something was asked for.
    pub fn connections(&self) -> usize {
        locked(&self.seen).connections
    }
}

fn locked(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Answers the requests of a connection until the client ends it.
fn answer_all(stream: impl Read + Write, file: &[u8], answers: Answers, seen: &Mutex<Seen>) {
    let (mut reader, mut is_first) = (BufReader::new(stream), true);
    while answer(&mut reader, file, answers, seen, is_first).is_some() {
        is_first = false;
    }
}

fn answer(
    reader: &mut BufReader<impl Read + Write>,
    file: &[u8],
    answers: Answers,
    seen: &Mutex<Seen>,
    is_first: bool,
) -> Option<()> {
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
    let parts = {
        let mut seen = locked(seen);
        seen.connections += usize::from(is_first);
        if path == "/take.gs4d" {
            seen.asked.push(range);
        }
        seen.asked.iter().flatten().count()
    };
    match range {
        _ if path != "/take.gs4d" => send(stream, "404 Not Found", b"no such file"),
        Some(_) if answers.fail_every > 0 && parts.is_multiple_of(answers.fail_every) => {
            send(stream, "503 Service Unavailable", b"come again")
        }
        Some(range) if !answers.no_parts => {
            let (status, part) = part_of(file, range);
            send(stream, &status, part)
        }
        _ => send(stream, "200 OK", file),
    }
}

fn send(stream: &mut impl Write, status: &str, body: &[u8]) -> Option<()> {
    let length = body.len();
    let head = format!("HTTP/1.1 {status}\r\nContent-Length: {length}\r\n\r\n");
    stream.write_all(head.as_bytes()).ok()?;
    stream.write_all(body).ok()?;
    stream.flush().ok()
}
