//! Listening, and what comes in.

use std::fs;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use foxglove::Context;
use http::header::{
    ACCEPT, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, LOCATION, REFERRER_POLICY, SET_COOKIE,
    X_CONTENT_TYPE_OPTIONS,
};
use http::{HeaderMap, HeaderValue, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;

use fringeflow_config::{Listen, MonitorConfiguration};
use fringeflow_runtime::dashboard_file;

use crate::exposition::Exposition;
use crate::metrics::Metrics;
use crate::shared::{Shared, ended};
use crate::viewers;

use super::guard::{COOKIE_NAME, Guard};
use super::{control, live, page};

/// Connections at once; those beyond are told so and closed.
const CONNECTIONS: usize = 256;
/// Bytes of the head of a request.
const HEAD_BYTES: usize = 16 * 1024;
/// Headers of a request.
const HEADERS: usize = 64;
/// How long the head of a request may take, and a connection be idle.
const HEAD_TIME: Duration = Duration::from_secs(10);
/// Bytes of the body of a request.
const BODY_BYTES: usize = 4096;
/// Pause after a failure to listen or to accept.
const PAUSE: Duration = Duration::from_secs(1);
/// Time that connections have to end.
const STOP_TIME: Duration = Duration::from_millis(500);
/// Threads that wait for answers of the supervisor.
const BLOCKING_THREADS: usize = 2;

/// What the page may load and do.
const CONTENT_SECURITY: &str = "default-src 'self'; img-src 'self' data: blob:; connect-src 'self' ws: wss:; \
                                base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The answer to a connection too many.
const TOO_MANY: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";

/// The running server, in a thread of its own.
#[derive(Debug)]
pub(crate) struct Server {
    thread: JoinHandle<()>,
    shared: Arc<Shared>,
}

/// What every request is answered from.
#[derive(Clone)]
pub(super) struct Answering {
    pub(super) shared: Arc<Shared>,
    guard: Arc<Guard>,
    metrics: Arc<Metrics>,
}

/// Where a request came in.
#[derive(Clone, Copy)]
struct Local(IpAddr);

impl Server {
    /// Begins to listen. Where that is not possible it is tried again, and told: a scan does not end for its dashboard.
    pub(crate) fn start(
        shared: &Arc<Shared>,
        settings: &MonitorConfiguration,
        guard: Guard,
        context: &Arc<Context>,
    ) -> Result<Self, String> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .max_blocking_threads(BLOCKING_THREADS)
            .build()
            .map_err(|error| format!("the server of the monitor cannot start: {error}"))?;
        let metrics = Arc::new(Metrics::new(Arc::clone(&shared.board), Arc::clone(&shared.clients)));
        let answering = Answering { shared: Arc::clone(shared), guard: Arc::new(guard), metrics };
        let (dashboard, foxglove, context) = (settings.dashboard, settings.foxglove, Arc::clone(context));
        let thread = std::thread::Builder::new().name("http".to_owned()).spawn(move || {
            runtime.block_on(serve(answering, dashboard, foxglove, context));
            runtime.shutdown_timeout(STOP_TIME);
        });
        let thread = thread.map_err(|error| format!("the thread of the server cannot start: {error}"))?;
        Ok(Self { thread, shared: Arc::clone(shared) })
    }

    /// Ends all connections.
    pub(crate) fn stop(self) {
        self.shared.stop.send_replace(true);
        // It has caught its own panics.
        let _ = self.thread.join();
    }
}

/// Listens until the service ends.
async fn serve(answering: Answering, dashboard: Listen, foxglove: Option<Listen>, context: Arc<Context>) {
    let mut stop = answering.shared.stop.subscribe();
    if let Some(listen) = foxglove {
        let (shared, guard) = (Arc::clone(&answering.shared), Arc::clone(&answering.guard));
        tokio::spawn(viewers::serve(shared, guard, listen, context));
    }
    tokio::select! {
        () = listen_and_accept(answering, dashboard) => {}
        () = ended(&mut stop) => {}
    }
}

async fn listen_and_accept(answering: Answering, listen: Listen) {
    let listener = bind("monitor.address", listen).await;
    match listener.local_addr() {
        Ok(address) => announce(&answering.shared, address),
        Err(error) => tracing::warn!("dashboard: {error}"),
    }
    let router = router(answering);
    let connections = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // As when this process has no more descriptors.
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let Ok(permit) = Arc::clone(&connections).try_acquire_owned() else {
            let _ = stream.try_write(TOO_MANY);
            continue;
        };
        let router = router.clone();
        tokio::spawn(async move {
            answer(stream, router).await;
            drop(permit);
        });
    }
}

/// Binds the address that a key of the configuration states; a default whose port is taken gives way to any other port.
pub(crate) async fn bind(key: &str, listen: Listen) -> TcpListener {
    let mut address = listen.address;
    loop {
        match TcpListener::bind(address).await {
            Ok(listener) => return listener,
            Err(_) if listen.is_default && address.port() != 0 => address.set_port(0),
            Err(error) => {
                tracing::warn!("{key}: the monitor cannot listen on {address}: {error}; set another address");
                tokio::time::sleep(PAUSE).await;
            }
        }
    }
}

/// Says where the page is: in the log, and to whoever asks for the state of the instance.
fn announce(shared: &Shared, address: SocketAddr) {
    let url = format!("http://{address}/");
    tracing::info!("dashboard: {url}");
    let file = dashboard_file(&shared.instance);
    if let Err(error) = write_new(&file, &url) {
        tracing::warn!("{}: {error}", file.display());
    }
}

fn write_new(file: &Path, text: &str) -> std::io::Result<()> {
    file.parent().map_or(Ok(()), fs::create_dir_all)?;
    fs::write(file, text)
}

/// Address of this machine that a connection came to.
pub(crate) fn local_ip(stream: &TcpStream) -> std::io::Result<IpAddr> {
    Ok(stream.local_addr()?.ip().to_canonical())
}

async fn answer(stream: TcpStream, router: Router) {
    let Ok(local) = local_ip(&stream) else { return };
    // Small messages go at once.
    let _ = stream.set_nodelay(true);
    let router = router.layer(axum::Extension(Local(local)));
    let mut http = hyper::server::conn::http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEAD_TIME).max_headers(HEADERS).max_buf_size(HEAD_BYTES);
    let connection = http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(router)).with_upgrades();
    // Whoever breaks off, or is too slow or too long, is not worth a line of the log.
    let _ = connection.await;
}

fn router(answering: Answering) -> Router {
    Router::new()
        .route("/", get(page::index))
        .route("/{*path}", get(page::file))
        .route("/metrics", get(metrics))
        .route("/figures", get(figures))
        .route("/live", get(live::upgrade))
        .route("/control", post(control::control))
        .layer(DefaultBodyLimit::max(BODY_BYTES))
        .layer(from_fn_with_state(answering.clone(), admit))
        .with_state(answering)
}

/// Lets a request in, or refuses it; all answers say how they may be used.
async fn admit(State(answering): State<Answering>, request: Request, next: Next) -> Response {
    let local = request.extensions().get::<Local>().map_or(IpAddr::from([0; 4]), |local| local.0);
    let checked = answering.guard.check_page(request.headers(), request.uri(), local);
    let mut response = match (checked, answering.guard.token_of_query(request.uri())) {
        (Err(refusal), _) => (refusal.status(), refusal.text()).into_response(),
        // From now on the cookie holds the token, which no history or log of a browser shows.
        (Ok(()), Some(token)) if request.uri().path() == "/" => signed_in(token),
        (Ok(()), _) => next.run(request).await,
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(CONTENT_SECURITY));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    response
}

fn signed_in(token: &str) -> Response {
    let cookie = format!("{COOKIE_NAME}={token}; Path=/; HttpOnly; SameSite=Strict");
    (StatusCode::SEE_OTHER, [(LOCATION, "/".to_owned()), (SET_COOKIE, cookie)]).into_response()
}

async fn metrics(State(answering): State<Answering>, headers: HeaderMap) -> Response {
    let accept = headers.get(ACCEPT).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let exposition = Exposition::accepted(accept);
    ([(CONTENT_TYPE, exposition.media_type())], exposition.of(answering.metrics.text())).into_response()
}

/// The figures of the last second.
async fn figures(State(answering): State<Answering>) -> Response {
    let figures = answering.shared.figures.borrow().to_string();
    ([(CONTENT_TYPE, "application/json")], figures).into_response()
}
