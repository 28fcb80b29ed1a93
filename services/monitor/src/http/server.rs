//! Listens for connections, and routes requests.

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
use crate::shared::{Shared, stopped};
use crate::viewers;

use super::guard::{COOKIE_NAME, Guard};
use super::state::ServerState;
use super::{control, live, page};

/// Largest number of connections at a time. Further ones get status 503 and are closed.
const MAX_CONNECTIONS: usize = 256;
/// Largest size of the head of a request, bytes.
const MAX_HEAD_BYTES: usize = 16 * 1024;
/// Largest number of headers of a request.
const MAX_HEADERS: usize = 64;
/// Time limit for the head of a request, and for an idle connection.
const HEAD_TIMEOUT: Duration = Duration::from_secs(10);
/// Largest size of the body of a request, bytes.
const MAX_BODY_BYTES: usize = 4096;
/// Pause after listening or accepting has failed.
const RETRY_PAUSE: Duration = Duration::from_secs(1);
/// Time that connections get to end when the service stops.
const STOP_TIMEOUT: Duration = Duration::from_millis(500);
/// Threads that wait for answers from the supervisor.
const BLOCKING_THREADS: usize = 2;

/// Content security policy of the page.
const CONTENT_SECURITY: &str = "default-src 'self'; img-src 'self' data: blob:; connect-src 'self' ws: wss:; \
                                base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The response to a connection beyond the limit.
const TOO_MANY_RESPONSE: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";

/// The running server. It has its own thread.
#[derive(Debug)]
pub(crate) struct Server {
    thread: JoinHandle<()>,
    shared: Arc<Shared>,
}

/// Address of this machine that a request arrived at.
#[derive(Clone, Copy)]
struct LocalAddress(IpAddr);

impl Server {
    /// Starts to listen. If that fails, the server logs it and tries again: a scan must not end because of its
    /// dashboard.
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
            .map_err(|error| format!("the monitor's server cannot start: {error}"))?;
        let metrics = Arc::new(Metrics::new(Arc::clone(&shared.status), Arc::clone(&shared.clients)));
        let server = ServerState { shared: Arc::clone(shared), guard: Arc::new(guard), metrics };
        let (dashboard, foxglove, context) = (settings.dashboard, settings.foxglove, Arc::clone(context));
        let thread = std::thread::Builder::new().name("http".to_owned()).spawn(move || {
            runtime.block_on(serve(server, dashboard, foxglove, context));
            runtime.shutdown_timeout(STOP_TIMEOUT);
        });
        let thread = thread.map_err(|error| format!("the thread of the monitor's server cannot start: {error}"))?;
        Ok(Self { thread, shared: Arc::clone(shared) })
    }

    /// Ends all connections.
    pub(crate) fn stop(self) {
        self.shared.stop.send_replace(true);
        // An error means that the thread has panicked, which was reported then.
        let _ = self.thread.join();
    }
}

/// Serves pages and viewers until the service stops.
async fn serve(server: ServerState, dashboard: Listen, foxglove: Option<Listen>, context: Arc<Context>) {
    let mut stop = server.shared.stop.subscribe();
    if let Some(listen) = foxglove {
        let (shared, guard) = (Arc::clone(&server.shared), Arc::clone(&server.guard));
        tokio::spawn(viewers::serve(shared, guard, listen, context));
    }
    tokio::select! {
        () = listen_and_accept(server, dashboard) => {}
        () = stopped(&mut stop) => {}
    }
}

async fn listen_and_accept(server: ServerState, listen: Listen) {
    let listener = bind("monitor.address", listen).await;
    match listener.local_addr() {
        Ok(address) => publish_address(&server.shared, address),
        Err(error) => tracing::warn!("dashboard: {error}"),
    }
    let router = router(server);
    let connections = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Accepting fails for example while the process has no free file descriptors.
            tokio::time::sleep(RETRY_PAUSE).await;
            continue;
        };
        let Ok(permit) = Arc::clone(&connections).try_acquire_owned() else {
            let _ = stream.try_write(TOO_MANY_RESPONSE);
            continue;
        };
        let router = router.clone();
        tokio::spawn(async move {
            serve_connection(stream, router).await;
            drop(permit);
        });
    }
}

/// Binds the address that a key of the configuration states. If the port of a default is taken, binds any free port.
/// Tries again until it succeeds.
pub(crate) async fn bind(key: &str, listen: Listen) -> TcpListener {
    let mut address = listen.address;
    loop {
        match TcpListener::bind(address).await {
            Ok(listener) => return listener,
            Err(_) if listen.is_default && address.port() != 0 => address.set_port(0),
            Err(error) => {
                tracing::warn!("{key}: the monitor cannot listen on {address}: {error}; set another address");
                tokio::time::sleep(RETRY_PAUSE).await;
            }
        }
    }
}

/// Publishes the URL of the page, in the log and in a file that `fringeflow status` reads.
fn publish_address(shared: &Shared, address: SocketAddr) {
    let url = format!("http://{address}/");
    tracing::info!("dashboard: {url}");
    let file = dashboard_file(&shared.instance);
    if let Err(error) = write_file(&file, &url) {
        tracing::warn!("{}: {error}", file.display());
    }
}

/// Writes a file, and creates its folder if it is missing.
fn write_file(file: &Path, text: &str) -> std::io::Result<()> {
    file.parent().map_or(Ok(()), fs::create_dir_all)?;
    fs::write(file, text)
}

/// Address of this machine that a connection arrived at.
pub(crate) fn local_ip(stream: &TcpStream) -> std::io::Result<IpAddr> {
    Ok(stream.local_addr()?.ip().to_canonical())
}

/// Answers the requests of a connection until it ends.
async fn serve_connection(stream: TcpStream, router: Router) {
    let Ok(local) = local_ip(&stream) else { return };
    // Sends small messages at once (TCP_NODELAY). If this fails, they are only late.
    let _ = stream.set_nodelay(true);
    let router = router.layer(axum::Extension(LocalAddress(local)));
    let mut http = hyper::server::conn::http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIMEOUT)
        .max_headers(MAX_HEADERS)
        .max_buf_size(MAX_HEAD_BYTES);
    let connection = http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(router)).with_upgrades();
    // Clients that disconnect or exceed a limit need no log line.
    let _ = connection.await;
}

fn router(server: ServerState) -> Router {
    Router::new()
        .route("/", get(page::index))
        .route("/{*path}", get(page::file))
        .route("/metrics", get(metrics))
        .route("/figures", get(figures))
        .route("/live", get(live::upgrade))
        .route("/control", post(control::control))
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .layer(from_fn_with_state(server.clone(), check_and_answer))
        .with_state(server)
}

/// Checks a request, and answers or refuses it. All responses get the security headers.
async fn check_and_answer(State(server): State<ServerState>, request: Request, next: Next) -> Response {
    let local = request.extensions().get::<LocalAddress>().map_or(IpAddr::from([0; 4]), |local| local.0);
    let checked = server.guard.check_page(request.headers(), request.uri(), local);
    let mut response = match (checked, server.guard.token_of_query(request.uri())) {
        (Err(refusal), _) => (refusal.status(), refusal.text()).into_response(),
        // From now on the token is in the cookie, so it does not stay in the browser's history or in logs.
        (Ok(()), Some(token)) if request.uri().path() == "/" => redirect_with_cookie(token),
        (Ok(()), _) => next.run(request).await,
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(CONTENT_SECURITY));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    response
}

/// Redirects to the page without a query, and stores the token in a cookie.
fn redirect_with_cookie(token: &str) -> Response {
    let cookie = format!("{COOKIE_NAME}={token}; Path=/; HttpOnly; SameSite=Strict");
    (StatusCode::SEE_OTHER, [(LOCATION, "/".to_owned()), (SET_COOKIE, cookie)]).into_response()
}

async fn metrics(State(server): State<ServerState>, headers: HeaderMap) -> Response {
    let accept = headers.get(ACCEPT).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let exposition = Exposition::from_accept(accept);
    ([(CONTENT_TYPE, exposition.media_type())], exposition.convert(server.metrics.text())).into_response()
}

/// Answers with the figures of the last second.
async fn figures(State(server): State<ServerState>) -> Response {
    let figures = server.shared.figures.borrow().to_string();
    ([(CONTENT_TYPE, "application/json")], figures).into_response()
}
