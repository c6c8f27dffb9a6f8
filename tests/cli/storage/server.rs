//! A store for tests: an S3 server on loopback (`moto`), behind a proxy that injects faults.
//!
//! In: the Python interpreter with `moto` that the variable `GS4D_MOTO` names; faults. Out: the address of the proxy, and the requests that
//! it has seen.

use crate::support::skip::skip;
use std::env;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// Time in which the server starts.
const START: Duration = Duration::from_secs(60);

/// What happens to a request.
#[derive(Debug, Clone, Copy)]
pub enum Fault {
    /// It is answered with status 500.
    Fails,
    /// The connection ends after so many bytes of the response.
    CutAfter(usize),
    /// The connection ends before the request is passed on.
    Dropped,
    /// It is not answered.
    Hangs,
}

/// Faults of the next requests of a method to names that end so.
#[derive(Debug, Clone)]
struct Plan {
    method: &'static str,
    ending: String,
    fault: Fault,
    times: usize,
}

/// A request that was seen.
#[derive(Debug, Clone)]
pub struct Seen {
    pub method: String,
    pub path: String,
    pub has_range: bool,
}

#[derive(Default)]
struct State {
    plans: Mutex<Vec<Plan>>,
    seen: Mutex<Vec<Seen>>,
    /// Requests that are answered before the server is lost, if it will be.
    left: Mutex<Option<usize>>,
}

impl State {
    /// Counts a request. Returns whether the server is lost.
    fn is_lost(&self) -> bool {
        match &mut *self.left.lock().expect("no thread panics") {
            None => false,
            Some(0) => true,
            Some(left) => {
                *left -= 1;
                false
            }
        }
    }
}

/// The server and the proxy. They end when it is dropped.
pub struct Server {
    moto: Child,
    pub address: String,
    state: Arc<State>,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.moto.kill();
        let _ = self.moto.wait();
    }
}

impl Server {
    /// Starts a server with an empty bucket `bucket`; `None`, after the test is reported as skipped, without `moto`.
    pub fn start() -> Option<Self> {
        let Some(python) = env::var_os("GS4D_MOTO") else {
            skip("GS4D_MOTO does not name a Python interpreter with moto");
            return None;
        };
        let free = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a free port");
        let mut command = Command::new(python);
        command.args(["-m", "moto.server", "-H", "127.0.0.1", "-p", &free.port().to_string()]);
        let moto = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the interpreter starts");
        let upstream = free.to_string();
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("an address").to_string();
        let state = Arc::<State>::default();
        let server = Self { moto, address, state: state.clone() };
        let began = Instant::now();
        while TcpStream::connect(&upstream).is_err() {
            assert!(began.elapsed() < START, "the server starts");
            thread::sleep(Duration::from_millis(50));
        }
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let (state, upstream) = (state.clone(), upstream.clone());
                thread::spawn(move || serve(client, &upstream, &state));
            }
        });
        assert_eq!(server.request("PUT", "/bucket", &[]).0, 200, "the bucket is made");
        Some(server)
    }

    /// From now on, the next `times` requests of this method to names with this ending have a fault.
    pub fn inject(&self, method: &'static str, ending: &str, fault: Fault, times: usize) {
        let plan = Plan { method, ending: ending.to_owned(), fault, times };
        self.state.plans.lock().expect("no thread panics").push(plan);
    }

    /// After so many further requests the server is lost: every connection ends without an answer.
    pub fn lose_after(&self, requests: usize) {
        *self.state.left.lock().expect("no thread panics") = Some(requests);
    }

    /// From now on, the server is there and no request has a fault.
    pub fn clear(&self) {
        self.state.plans.lock().expect("no thread panics").clear();
        *self.state.left.lock().expect("no thread panics") = None;
    }

    /// Returns the requests since the last call.
    pub fn seen(&self) -> Vec<Seen> {
        std::mem::take(&mut self.state.seen.lock().expect("no thread panics"))
    }

    /// Stores an object.
    pub fn put(&self, name: &str, bytes: &[u8]) {
        assert_eq!(self.request("PUT", &format!("/bucket/{name}"), bytes).0, 200, "{name} is stored");
        self.seen();
    }

    /// Returns an object; `None` if there is none.
    pub fn get(&self, name: &str) -> Option<Vec<u8>> {
        let (status, bytes) = self.request("GET", &format!("/bucket/{name}"), &[]);
        self.seen();
        (status == 200).then_some(bytes)
    }

    fn request(&self, method: &str, path: &str, body: &[u8]) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.address).expect("the proxy listens");
        let signed =
            "AWS4-HMAC-SHA256 Credential=id/20260101/us-east-1/s3/aws4_request, SignedHeaders=host, Signature=0";
        let headers = format!("Host: {}\r\nAuthorization: {signed}\r\nx-amz-acl: public-read", self.address);
        let head = format!("{method} {path} HTTP/1.1\r\n{headers}\r\nContent-Length: {}\r\n\r\n", body.len());
        stream.write_all(&[head.as_bytes(), body].concat()).expect("the proxy reads");
        let mut response = Vec::new();
        stream.read_to_end(&mut response).expect("the proxy answers");
        let end = response.windows(4).position(|bytes| bytes == b"\r\n\r\n").expect("a head") + 4;
        let status = String::from_utf8_lossy(&response[9..12]).parse().expect("a status");
        (status, response.split_off(end))
    }
}

/// Passes one request on, and its response back, with the fault that is planned for it.
fn serve(mut client: TcpStream, upstream: &str, state: &State) {
    let mut reader = BufReader::new(client.try_clone().expect("a socket can be cloned"));
    let (mut head, mut length, mut has_range) = (String::new(), 0, false);
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line).unwrap_or(0) == 0 {
            return;
        }
        let lower = line.to_ascii_lowercase();
        if let Some(value) = lower.strip_prefix("content-length:") {
            length = value.trim().parse().expect("a length");
        }
        has_range |= lower.starts_with("range:");
        if line == "\r\n" {
            break;
        }
        if !lower.starts_with("connection:") {
            head += &line;
        }
    }
    let mut body = vec![0; length];
    if reader.read_exact(&mut body).is_err() || state.is_lost() {
        return;
    }
    let mut words = head.split_whitespace().map(str::to_owned);
    let (method, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let name = path.split('?').next().unwrap_or_default().to_owned();
    state.seen.lock().expect("no thread panics").push(Seen { method: method.clone(), path, has_range });
    let fault = {
        let mut plans = state.plans.lock().expect("no thread panics");
        let plan = plans.iter_mut().find(|p| p.times > 0 && p.method == method && name.ends_with(&p.ending));
        plan.map(|plan| {
            plan.times -= 1;
            plan.fault
        })
    };
    match fault {
        Some(Fault::Fails) => {
            let _ = client.write_all(b"HTTP/1.1 500 Error\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        }
        Some(Fault::Dropped) => {}
        Some(Fault::Hangs) => {
            // Until the client gives up.
            let _ = reader.read_to_end(&mut Vec::new());
        }
        Some(Fault::CutAfter(_)) | None => {
            let mut server = TcpStream::connect(upstream).expect("the server listens");
            let request = [head.as_bytes(), b"Connection: close\r\n\r\n", &body].concat();
            let mut response = Vec::new();
            if server.write_all(&request).and_then(|()| server.read_to_end(&mut response).map(drop)).is_err() {
                return;
            }
            let end = match fault {
                Some(Fault::CutAfter(bytes)) => bytes.min(response.len()),
                _ => response.len(),
            };
            let _ = client.write_all(&response[..end]);
        }
    }
    let _ = client.shutdown(Shutdown::Both);
}
