//! One request of bytes of a file of a server.
//!
//! In: an address, where the bytes are in the file. Out: what the server has sent, given to a function when all of it
//! has been received. Outside browsers, connections are kept open for later requests, and servers are trusted by the
//! certificates of the system; browsers see to both themselves.

use std::io::Error;

/// Bytes of a file that are asked for.
pub(super) struct Request {
    pub url: String,
    /// The first of the bytes.
    pub position: u64,
    /// Their number; `None`: all up to the end of the file.
    pub count: Option<u64>,
}

/// What a server has answered.
pub(super) struct Response {
    pub status: u16,
    /// The name of the status.
    pub status_text: String,
    /// The header `Content-Range`, if there is one and a page may read it.
    pub content_range: Option<String>,
    /// The body; empty where the status is not one of bytes that were asked for.
    pub bytes: Vec<u8>,
}

impl Request {
    /// Returns the header `Range`; `None` for all of the file.
    fn range(&self) -> Option<String> {
        let Self { position, count, .. } = *self;
        match count {
            Some(count) => Some(format!("bytes={position}-{}", position.saturating_add(count.max(1)) - 1)),
            None => (position > 0).then(|| format!("bytes={position}-")),
        }
    }
}

#[cfg(not(target_arch = "wasm32"))]
pub(super) use native::Client;

#[cfg(not(target_arch = "wasm32"))]
mod native {
    use super::{Error, Request, Response};
    use std::io::{ErrorKind, Read, copy, sink};
    use std::thread;
    use std::time::Duration;
    use ureq::http::header::{ACCEPT_ENCODING, CONTENT_RANGE, RANGE};
    use ureq::tls::{RootCerts, TlsConfig};
    use ureq::{Agent, Body};

    /// A server has to accept a connection, to begin an answer, and to send each next piece of it within this time.
    /// Chunk files are asked for again after their own deadline.
    const PATIENCE: Duration = Duration::from_secs(30);
    /// Connections that are kept open to one server, and to all, and for how long: some servers close them after 5 s.
    const IDLE_CONNECTIONS: [usize; 2] = [8, 32];
    const IDLE: Duration = Duration::from_secs(4);
    /// Most bytes that are received of an answer without bytes of the file, so that its connection stays open.
    const TEXT: u64 = 64 << 10;

    /// The connections to servers; clones share them.
    #[derive(Debug, Clone)]
    pub(in crate::plugin::stream) struct Client(Agent);

    impl Default for Client {
        fn default() -> Self {
            // The verifier of Android needs a handle of the app's Java side.
            let roots = if cfg!(target_os = "android") { RootCerts::WebPki } else { RootCerts::PlatformVerifier };
            let [of_server, of_all] = IDLE_CONNECTIONS;
            // A setting of one request would read the certificates of the system again.
            let config = Agent::config_builder()
                .http_status_as_error(false)
                .user_agent(concat!(env!("CARGO_PKG_NAME"), "/", env!("CARGO_PKG_VERSION")))
                .tls_config(TlsConfig::builder().root_certs(roots).build())
                .timeout_connect(Some(PATIENCE))
                .timeout_recv_response(Some(PATIENCE))
                .timeout_per_read(Some(PATIENCE))
                .max_idle_age(IDLE)
                .max_idle_connections_per_host(of_server)
                .max_idle_connections(of_all);
            Self(config.build().new_agent())
        }
    }

    impl Client {
        /// Asks a server, and calls `done` with its answer on another thread.
        pub(in crate::plugin::stream) fn fetch(
            &self,
            request: Request,
            done: impl FnOnce(Result<Response, Error>) + Clone + Send + 'static,
        ) {
            let (agent, own) = (self.0.clone(), done.clone());
            let spawned = thread::Builder::new()
                .name("HTTP request".to_owned())
                .spawn(move || own(asked(&agent, &request).map_err(|error| told(error.into_io()))));
            if let Err(error) = spawned {
                done(Err(error));
            }
        }
    }

    fn asked(agent: &Agent, request: &Request) -> Result<Response, ureq::Error> {
        let Request { url, position, count } = request;
        let ask = || {
            // Parts of a compressed answer are not parts of the file.
            let asking = agent.get(url).header(ACCEPT_ENCODING, "identity");
            match request.range() {
                Some(range) => asking.header(RANGE, range).call(),
                None => asking.call(),
            }
        };
        let answer = match ask() {
            // The server has closed a connection that was kept open.
            Err(ureq::Error::Io(error)) if is_closed(error.kind()) => ask(),
            answer => answer,
        }?;
        let status = answer.status();
        let content_range = answer.headers().get(CONTENT_RANGE).and_then(|value| value.to_str().ok());
        Ok(Response {
            status: status.as_u16(),
            status_text: status.canonical_reason().unwrap_or_default().to_owned(),
            content_range: content_range.map(str::to_owned),
            bytes: match status.as_u16() {
                206 => received(answer.into_body(), count.unwrap_or(u64::MAX))?,
                200 if *position == 0 => received(answer.into_body(), u64::MAX)?,
                _ => {
                    // What the text says, and whether it arrives, is of no use.
                    let _ = copy(&mut answer.into_body().into_reader().take(TEXT), &mut sink());
                    Vec::new()
                }
            },
        })
    }

    /// Returns the same error, with the remedy for a server that is not trusted.
    fn told(error: Error) -> Error {
        match error.to_string() {
            text if text.contains("certificate") => {
                let remedy = "the certificates of the system have to include that of the server's issuer";
                Error::new(error.kind(), format!("{text}: {remedy}"))
            }
            _ => error,
        }
    }

    fn is_closed(kind: ErrorKind) -> bool {
        use ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, UnexpectedEof};
        matches!(kind, BrokenPipe | ConnectionAborted | ConnectionReset | UnexpectedEof)
    }

    /// Returns the beginning of a body, up to `most` bytes.
    fn received(body: Body, most: u64) -> Result<Vec<u8>, ureq::Error> {
        let mut bytes = Vec::new();
        // The read that finds the end of the body, after its last byte, gives the connection back.
        body.into_reader().take(most.saturating_add(1)).read_to_end(&mut bytes)?;
        bytes.truncate(usize::try_from(most).unwrap_or(usize::MAX));
        Ok(bytes)
    }
}

#[cfg(target_arch = "wasm32")]
pub(super) use browser::Client;

#[cfg(target_arch = "wasm32")]
mod browser {
    use super::{Error, Request, Response};

    /// The page that the app is in.
    #[derive(Debug, Clone, Default)]
    pub(in crate::plugin::stream) struct Client;

    impl Client {
        /// Asks a server, and calls `done` with its answer.
        pub(in crate::plugin::stream) fn fetch(
            &self,
            request: Request,
            done: impl FnOnce(Result<Response, Error>) + Send + 'static,
        ) {
            let mut asking = ehttp::Request::get(&request.url);
            if let Some(range) = request.range() {
                asking.headers.insert("Range", range);
            }
            // Those of the page.
            asking.credentials = ehttp::Credentials::SameOrigin;
            ehttp::fetch(asking, move |answer| {
                done(answer.map_err(Error::other).map(|answer| Response {
                    status: answer.status,
                    status_text: answer.status_text,
                    content_range: answer.headers.get("content-range").map(str::to_owned),
                    bytes: answer.bytes,
                }));
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_name_the_first_and_the_last_byte() {
        let range = |position, count| Request { url: String::new(), position, count }.range();
        assert_eq!(range(0, None), None, "all of the file");
        assert_eq!(range(5, None).as_deref(), Some("bytes=5-"), "the rest");
        assert_eq!(range(5, Some(3)).as_deref(), Some("bytes=5-7"), "three bytes");
        assert_eq!(range(5, Some(0)).as_deref(), Some("bytes=5-5"), "no range is empty");
    }
}
