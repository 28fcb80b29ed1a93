//! The public end of the viewers' server: a proxy that checks each request.
//!
//! The server of the SDK has no authentication, waits without limit for a handshake, and stops for good if it cannot
//! accept a connection. So it listens on a random loopback address and port that clients do not know. Clients connect
//! to the public address, where their requests are checked and their number is limited. Then bytes are forwarded
//! unchanged.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use foxglove::{Context, WebSocketServer};
use http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri};
use tokio::io::{AsyncReadExt, AsyncWriteExt, copy};
use tokio::net::TcpStream;
use tokio::sync::Semaphore;

use fringeflow_config::Listen;

use crate::http::{Guard, bind, local_ip};
use crate::shared::Shared;

/// Largest number of viewers at a time.
const MAX_VIEWERS: usize = 16;
/// Largest size of the head of a request, and largest number of headers in it.
const MAX_HEAD_BYTES: usize = 16 * 1024;
const MAX_HEADERS: usize = 64;
/// Time limit for the head of a request.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);
/// Bytes that a viewer may send over the whole connection. Viewers send little but subscriptions.
const MAX_SENT_BYTES: u64 = 1 << 20;
/// Messages that wait for a viewer. Beyond that the oldest is dropped.
const MAX_BACKLOG: usize = 8;
/// Pause after a connection could not be accepted.
const RETRY_PAUSE: Duration = Duration::from_secs(1);

/// The head of a request, and all bytes received with it.
struct RequestHead {
    bytes: Vec<u8>,
    headers: HeaderMap,
    uri: Uri,
}

/// Serves viewers until the task is cancelled.
pub(crate) async fn serve(shared: Arc<Shared>, guard: Arc<Guard>, listen: Listen, context: Arc<Context>) {
    let Some(sdk_address) = start_sdk_server(&shared, &context).await else { return };
    let listener = bind("monitor.foxglove", listen).await;
    if let Ok(address) = listener.local_addr() {
        let url = format!("ws://{address}");
        tracing::info!("Foxglove, Lichtblick and Rerun: {url}");
        shared.status().foxglove = Some(url);
    }
    let viewers = Arc::new(Semaphore::new(MAX_VIEWERS));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(RETRY_PAUSE).await;
            continue;
        };
        let Ok(permit) = Arc::clone(&viewers).try_acquire_owned() else {
            let _ = stream.try_write(&response(StatusCode::SERVICE_UNAVAILABLE, ""));
            continue;
        };
        let guard = Arc::clone(&guard);
        tokio::spawn(async move {
            // Errors need no log line: mostly, the viewer has disconnected.
            let _ = check_and_forward(stream, &guard, sdk_address).await;
            drop(permit);
        });
    }
}

/// Starts the server of the SDK at a random loopback address. Returns `None`, with an error in the log, if that fails.
async fn start_sdk_server(shared: &Shared, context: &Arc<Context>) -> Option<SocketAddr> {
    let mut random = [0; 3];
    // Without randomness the address is only easier to guess.
    let _ = rustix::rand::getrandom(&mut random, rustix::rand::GetRandomFlags::empty());
    let address = Ipv4Addr::new(127, random[0], random[1], random[2].clamp(1, 254));
    let server = WebSocketServer::new()
        .name(format!("fringeflow {}", shared.instance.name()))
        .bind(address.to_string(), 0)
        .message_backlog_size(MAX_BACKLOG)
        .context(context);
    match server.start().await {
        Ok(handle) => Some(SocketAddr::new(IpAddr::V4(address), handle.port())),
        Err(error) => {
            tracing::error!("the server for viewers cannot start: {error}");
            None
        }
    }
}

/// Checks the request of a viewer, and then forwards bytes in both directions.
async fn check_and_forward(mut viewer: TcpStream, guard: &Guard, sdk_address: SocketAddr) -> std::io::Result<()> {
    let local = local_ip(&viewer)?;
    let Some(head) = tokio::time::timeout(HEAD_TIMEOUT, read_head(&mut viewer)).await.ok().flatten() else {
        return viewer.write_all(&response(StatusCode::BAD_REQUEST, "This is not the request of a viewer.\n")).await;
    };
    if let Err(refusal) = guard.check_viewer(&head.headers, &head.uri, local) {
        return viewer.write_all(&response(refusal.status(), refusal.text())).await;
    }
    viewer.set_nodelay(true)?;
    let mut server = TcpStream::connect(sdk_address).await?;
    server.set_nodelay(true)?;
    server.write_all(&head.bytes).await?;
    let (from_viewer, mut to_viewer) = viewer.split();
    let (mut from_server, mut to_server) = server.split();
    let mut from_viewer = from_viewer.take(MAX_SENT_BYTES);
    // If one direction ends, both connections are closed.
    tokio::select! {
        done = copy(&mut from_viewer, &mut to_server) => done,
        done = copy(&mut from_server, &mut to_viewer) => done,
    }
    .map(drop)
}

/// Reads the head of a request; returns `None` if it is invalid or too long.
async fn read_head(stream: &mut TcpStream) -> Option<RequestHead> {
    let mut bytes = Vec::with_capacity(1024);
    loop {
        let left = (MAX_HEAD_BYTES - bytes.len()) as u64;
        if stream.take(left).read_buf(&mut bytes).await.ok()? == 0 {
            return None;
        }
        let mut slots = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut request = httparse::Request::new(&mut slots);
        if request.parse(&bytes).ok()?.is_complete() {
            let uri = request.path?.parse().ok()?;
            let header = |header: &httparse::Header<'_>| {
                Some((HeaderName::try_from(header.name).ok()?, HeaderValue::from_bytes(header.value).ok()?))
            };
            let headers = request.headers.iter().map(header).collect::<Option<HeaderMap>>()?;
            return Some(RequestHead { headers, uri, bytes });
        }
    }
}

fn response(status: StatusCode, text: &str) -> Vec<u8> {
    let length = text.len();
    format!(
        "HTTP/1.1 {status}\r\nConnection: close\r\nContent-Type: text/plain\r\nContent-Length: {length}\r\n\r\n{text}"
    )
    .into_bytes()
}
