//! The monitor beside a running instance: who is let in, what is told, and what it may cost the scan.

mod clients;
mod dashboard;
mod page;
mod prometheus;
mod strangers;
mod viewers;

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use serde_json::Value;

use crate::support::{Arguments, Bench, Live};

/// Only there against hanging.
const PATIENCE: Duration = Duration::from_secs(60);

/// An instance whose monitor is reached over HTTP.
struct Watched<'a> {
    live: Live<'a>,
    address: SocketAddr,
}

/// What a server answered.
#[derive(Debug)]
struct Answer {
    status: u16,
    head: String,
    body: String,
}

/// An instance with a monitor on ports that are free, and what else its `[monitor]` says.
fn bench(more: &str) -> Bench {
    bench_with(&[], more)
}

/// [`bench`] with changes to the configuration.
fn bench_with(changes: &[(&str, &str)], more: &str) -> Bench {
    let on = format!("enabled = true\naddress = \"127.0.0.1:0\"\nfoxglove = \"127.0.0.1:0\"\n{more}");
    Bench::with(&[changes, &[("enabled = false", on.as_str())]].concat())
}

impl<'a> Watched<'a> {
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
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Sends bytes, and reads the answer until the other side closes.
    fn send(&self, request: &[u8]) -> Answer {
        let mut stream = self.connect();
        // A request that is refused early may not be read to its end.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        Answer::of(&answer)
    }

    /// A request with headers of its own.
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

    /// The figures of the last second.
    fn figures(&self) -> Value {
        serde_json::from_str(&self.get("/figures").body).unwrap()
    }

    /// Sends a command as the page does.
    fn control(&self, wish: &Value) -> Answer {
        self.request("POST", "/control", &[("Content-Type", "application/json")], &wish.to_string())
    }
}

impl Answer {
    fn of(bytes: &[u8]) -> Self {
        let text = String::from_utf8_lossy(bytes);
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
        Self { status, head: head.to_ascii_lowercase(), body: body.to_owned() }
    }
}

/// Host and port of a URL.
fn host_of(url: &str) -> &str {
    url.split('/').nth(2).unwrap()
}
