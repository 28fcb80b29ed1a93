//! The monitor of a running instance: access, content, and its effect on the scan.

mod access;
mod clients;
mod dashboard;
mod page;
pub(crate) mod prometheus;
mod viewers;

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use serde_json::Value;

use crate::support::{Arguments, Bench, Live};

/// Fails a test that hangs.
const TIMEOUT: Duration = Duration::from_secs(60);

/// An instance whose monitor answers over HTTP.
struct Watched<'a> {
    live: Live<'a>,
    address: SocketAddr,
}

/// Answer of an HTTP server.
#[derive(Debug)]
struct Answer {
    status: u16,
    /// In lower case.
    head: String,
    body: String,
}

/// Creates a bench with a monitor on free ports, and further lines in the table `[monitor]`.
fn monitor_bench(more: &str) -> Bench {
    monitor_bench_with_changes(&[], more)
}

/// [`monitor_bench`] with further changes to the configuration.
fn monitor_bench_with_changes(changes: &[(&str, &str)], more: &str) -> Bench {
    let on = format!("enabled = true\naddress = \"127.0.0.1:0\"\nfoxglove = \"127.0.0.1:0\"\n{more}");
    Bench::with_changes(&[changes, &[("enabled = false", on.as_str())]].concat())
}

impl<'a> Watched<'a> {
    /// Starts an instance, and waits until its dashboard listens.
    fn start(bench: &'a Bench, arguments: Arguments<'_>) -> Self {
        let live = bench.start(arguments);
        let mut address = None;
        live.wait_until("the dashboard listens", || {
            let status = bench.json(&[0], &[&"status", &"t", &"--json"]);
            address = status["dashboard"].as_str().map(|url| host_of(url).parse().unwrap());
            address.is_some()
        });
        Self { live, address: address.unwrap() }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        stream
    }

    /// Sends bytes, and reads the answer until the server closes the connection.
    fn send(&self, request: &[u8]) -> Answer {
        let mut stream = self.connect();
        // Errors are ignored: a server that refuses a request may close before it has read everything.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        Answer::parse(&answer)
    }

    /// Sends a request with these headers. Adds the right host unless they name one.
    fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        let mut request =
            format!("{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n", body.len());
        if !headers.iter().any(|(name, _)| *name == "Host") {
            request += &format!("Host: {}\r\n", self.address);
        }
        for (name, value) in headers {
            request += &format!("{name}: {value}\r\n");
        }
        self.send(format!("{request}\r\n{body}").as_bytes())
    }

    fn get(&self, path: &str) -> Answer {
        self.request("GET", path, &[], "")
    }

    /// Returns the figures of the last second.
    fn figures(&self) -> Value {
        serde_json::from_str(&self.get("/figures").body).unwrap()
    }

    /// Sends a command as the page does.
    fn control(&self, command: &Value) -> Answer {
        self.request("POST", "/control", &[("Content-Type", "application/json")], &command.to_string())
    }
}

impl Answer {
    fn parse(bytes: &[u8]) -> Self {
        let text = String::from_utf8_lossy(bytes);
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
        Self { status, head: head.to_ascii_lowercase(), body: body.to_owned() }
    }
}

/// Returns host and port of a URL.
fn host_of(url: &str) -> &str {
    url.split('/').nth(2).unwrap()
}
