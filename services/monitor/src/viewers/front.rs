//! The door to the viewers' server.
//!
//! The server of the SDK has no authentication, waits without end for a handshake, and stops for good when it cannot accept a
//! connection. So it listens on a secret port and address of this machine. Clients connect to the public address, where they
//! are checked and counted first. Then bytes pass as they are.

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

/// Viewers at once.
const VIEWERS: usize = 16;
/// Bytes and headers of the head of a request.
const HEAD_BYTES: usize = 16 * 1024;
const HEADERS: usize = 64;
/// How long the head may take.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Bytes that a viewer may send in all: it subscribes, and hardly says more.
const SENT_BYTES: u64 = 1 << 20;
/// Messages that wait for a viewer; then the oldest goes.
const BACKLOG: usize = 8;
/// Pause after a failure to accept.
const PAUSE: Duration = Duration::from_secs(1);

/// The head of a request, and what came with it.
struct Head {
    bytes: Vec<u8>,
    headers: HeaderMap,
    uri: Uri,
}

/// Serves viewers until the task is ended.
pub(crate) async fn serve(shared: Arc<Shared>, guard: Arc<Guard>, listen: Listen, context: Arc<Context>) {
    let Some(inner) = start_inner(&shared, &context).await else { return };
    let listener = bind("monitor.foxglove", listen).await;
    if let Ok(address) = listener.local_addr() {
        let url = format!("ws://{address}");
        tracing::info!("Foxglove, Lichtblick and Rerun: {url}");
        shared.board().foxglove = Some(url);
    }
    let viewers = Arc::new(Semaphore::new(VIEWERS));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let Ok(permit) = Arc::clone(&viewers).try_acquire_owned() else {
            let _ = stream.try_write(&answer(StatusCode::SERVICE_UNAVAILABLE, ""));
            continue;
        };
        let guard = Arc::clone(&guard);
        tokio::spawn(async move {
            // A viewer that went away is no news.
            let _ = admit(stream, &guard, inner).await;
            drop(permit);
        });
    }
}

/// Starts the server of the SDK at an address of this machine that nobody can guess.
async fn start_inner(shared: &Shared, context: &Arc<Context>) -> Option<SocketAddr> {
    let mut random = [0; 3];
    // Without randomness the address is only easier to guess.
    let _ = rustix::rand::getrandom(&mut random, rustix::rand::GetRandomFlags::empty());
    let address = Ipv4Addr::new(127, random[0], random[1], random[2].clamp(1, 254));
    let server = WebSocketServer::new()
        .name(format!("fringeflow {}", shared.instance.name()))
        .bind(address.to_string(), 0)
        .message_backlog_size(BACKLOG)
        .context(context);
    match server.start().await {
        Ok(handle) => Some(SocketAddr::new(IpAddr::V4(address), handle.port())),
        Err(error) => {
            tracing::error!("the server for viewers cannot start: {error}");
            None
        }
    }
}

/// Looks at whoever comes, and lets bytes pass both ways.
async fn admit(mut viewer: TcpStream, guard: &Guard, inner: SocketAddr) -> std::io::Result<()> {
    let local = local_ip(&viewer)?;
    let Some(head) = tokio::time::timeout(HEAD_TIME, read_head(&mut viewer)).await.ok().flatten() else {
        return viewer.write_all(&answer(StatusCode::BAD_REQUEST, "This is not a request of a viewer.\n")).await;
    };
    if let Err(refusal) = guard.check_viewer(&head.headers, &head.uri, local) {
        return viewer.write_all(&answer(refusal.status(), refusal.text())).await;
    }
    viewer.set_nodelay(true)?;
    let mut inner = TcpStream::connect(inner).await?;
    inner.set_nodelay(true)?;
    inner.write_all(&head.bytes).await?;
    let (from_viewer, mut to_viewer) = viewer.split();
    let (mut from_inner, mut to_inner) = inner.split();
    let mut from_viewer = from_viewer.take(SENT_BYTES);
    // Either end closes both.
    tokio::select! {
        done = copy(&mut from_viewer, &mut to_inner) => done,
        done = copy(&mut from_inner, &mut to_viewer) => done,
    }
    .map(drop)
}

/// Reads the head of a request; `None` for what is none, or too long.
async fn read_head(stream: &mut TcpStream) -> Option<Head> {
    let mut bytes = Vec::with_capacity(1024);
    loop {
        let before = bytes.len();
        let room = (HEAD_BYTES - before) as u64;
        if stream.take(room).read_buf(&mut bytes).await.ok()? == 0 {
            return None;
        }
        let mut found = [httparse::EMPTY_HEADER; HEADERS];
        let mut request = httparse::Request::new(&mut found);
        if request.parse(&bytes).ok()?.is_complete() {
            let uri = request.path?.parse().ok()?;
            let header = |header: &httparse::Header<'_>| {
                Some((HeaderName::try_from(header.name).ok()?, HeaderValue::from_bytes(header.value).ok()?))
            };
            let headers = request.headers.iter().map(header).collect::<Option<HeaderMap>>()?;
            return Some(Head { headers, uri, bytes });
        }
    }
}

fn answer(status: StatusCode, text: &str) -> Vec<u8> {
    let length = text.len();
    format!(
        "HTTP/1.1 {status}\r\nConnection: close\r\nContent-Type: text/plain\r\nContent-Length: {length}\r\n\r\n{text}"
    )
    .into_bytes()
}
