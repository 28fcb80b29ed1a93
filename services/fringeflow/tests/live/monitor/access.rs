//! Security of the monitor: foreign and malformed requests are refused, slow and many connections are limited, and
//! other machines have no access by default.

use std::time::Instant;

use super::*;

/// Number of connections that one client opens at once.
const CONNECTIONS: usize = 1000;
/// The server serves fewer connections than this at once.
const MAX_SERVED: usize = 256;

#[test]
fn requests_with_foreign_hosts_or_origins_are_refused() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    let own = watched.address.to_string();
    for host in ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "169.254.1.1"] {
        for path in ["/", "/metrics", "/figures", "/live", "/control"] {
            assert_eq!(watched.request("GET", path, &[("Host", host)], "").status, 421, "{host} {path}");
        }
    }
    let origin = |origin, path| {
        let upgrade = [
            ("Upgrade", "websocket"),
            ("Sec-WebSocket-Version", "13"),
            ("Sec-WebSocket-Key", "AAAAAAAAAAAAAAAAAAAAAA=="),
        ];
        let headers = [[("Host", own.as_str()), ("Origin", origin)].as_slice(), &upgrade].concat();
        watched.request("GET", path, &headers, "").status
    };
    for foreign in ["http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:1"] {
        assert_eq!([origin(foreign, "/live"), origin(foreign, "/figures")], [403, 403], "{foreign}");
    }
    assert_eq!(origin(&format!("http://{own}"), "/figures"), 200);
    let json = ("Content-Type", "application/json");
    let command = r#"{"command": "stop"}"#;
    assert_eq!(watched.request("POST", "/control", &[json, ("Origin", "http://evil.example")], command).status, 403);
    // Media types that a form, or a script of another origin, can send without permission.
    for media_type in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"] {
        assert_eq!(watched.request("POST", "/control", &[("Content-Type", media_type)], command).status, 415);
    }
    assert_eq!(watched.figures()["state"]["scanning"], true);
    watched.live.quit().assert_balanced();
}

#[test]
fn malformed_requests_are_refused_and_the_server_goes_on() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    for path in ["/nothing", "/../Cargo.toml", "/%2e%2e/%2e%2e/etc/passwd", "/app/", "/vendor/SHA256SUMS", "/figures/x"]
    {
        assert_eq!(watched.get(path).status, 404, "{path}");
    }
    for method in ["DELETE", "PUT", "PATCH", "OPTIONS", "TRACE", "CONNECT", "POST", "BREW"] {
        assert!((400..=405).contains(&watched.request(method, "/metrics", &[], "").status), "{method}");
    }
    assert_eq!(watched.request("GET", "/control", &[], "").status, 405);
    let long = "x".repeat(100_000);
    assert!([400, 431].contains(&watched.request("GET", "/", &[("X-Long", &long)], "").status));
    assert!([400, 414, 431].contains(&watched.get(&format!("/{long}")).status));
    let many: Vec<(String, String)> = (0..500).map(|n| (format!("X-{n}"), n.to_string())).collect();
    let many: Vec<(&str, &str)> = many.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect();
    assert!([400, 431].contains(&watched.request("GET", "/", &many, "").status));
    assert_eq!(watched.request("POST", "/control", &[("Content-Type", "application/json")], &long).status, 413);
    assert_eq!(watched.send(b"GET / HTTP/1.1\r\n\r\n").status, 421);
    assert_eq!(watched.send(b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\nConnection: close\r\n\r\n").status, 421);
    for nonsense in
        [b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".as_slice(), b"\r\n\r\n\r\n", b"GET\0/ HTTP/9\r\n\r\n"]
    {
        assert!(watched.send(nonsense).status < 500);
    }
    assert_eq!(watched.get("/figures").status, 200);
    watched.live.quit().assert_undisturbed();
}

#[test]
fn slow_requests_are_cut_off_and_the_number_of_connections_is_limited() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    let mut slow = watched.connect();
    slow.write_all(b"GET /figures HTTP/1.1\r\nHost:").unwrap();
    let start = Instant::now();
    // A byte now and then does not extend the deadline.
    slow.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
    let is_cut = |stream: &mut TcpStream| {
        let is_open = |result: std::io::Result<usize>| matches!(&result, Err(error) if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut));
        stream.write_all(b" ").is_err() || !is_open(stream.read(&mut [0; 256]))
    };
    while !is_cut(&mut slow) {
        assert!(start.elapsed() < TIMEOUT, "a slow request is never cut off");
    }
    let mut held: Vec<TcpStream> = (0..CONNECTIONS).filter_map(|_| TcpStream::connect(watched.address).ok()).collect();
    let refused = |stream: &mut TcpStream| {
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        Answer::parse(&answer).status == 503
    };
    assert!(held.len() > MAX_SERVED && held[MAX_SERVED..].iter_mut().any(refused), "all {} are served", held.len());
    drop(held);
    watched.live.wait_until("the server answers again", || watched.get("/figures").status == 200);
    watched.live.wait_for_clouds(1);
    watched.live.quit().assert_balanced();
}

#[test]
fn every_path_requires_the_configured_token() {
    let bench = monitor_bench("token_file = \"token\"\n");
    let token = "0123456789abcdef";
    std::fs::write(bench.path("token"), token).unwrap();
    let watched = Watched::start(&bench, &[]);
    for path in ["/", "/metrics", "/figures", "/live"] {
        assert_eq!(watched.get(path).status, 401, "{path}");
    }
    let bearer = format!("Bearer {token}");
    assert_eq!(watched.request("GET", "/metrics", &[("Authorization", &bearer)], "").status, 200);
    assert_eq!(watched.request("GET", "/metrics", &[("Authorization", "Bearer 0123456789abcdeg")], "").status, 401);
    let signed_in = watched.get(&format!("/?token={token}"));
    assert_eq!(signed_in.status, 303);
    assert!(signed_in.head.contains("httponly") && signed_in.head.contains("samesite=strict"), "{signed_in:?}");
    assert_eq!(watched.request("GET", "/figures", &[("Cookie", &format!("fringeflow_token={token}"))], "").status, 200);
    watched.live.quit().assert_balanced();
}

#[test]
fn all_servers_listen_on_this_machine_only_by_default() {
    // Without the table [monitor].
    let bench = Bench::with_changes(&[("[monitor]\nenabled = false\n", "")]);
    let watched = Watched::start(&bench, &[]);
    watched.live.wait_for_clouds(1);
    let listening: Vec<String> = crate::support::SERVICES
        .iter()
        .filter_map(|service| bench.pid_of(service))
        .chain([watched.live.pid()])
        .flat_map(listening_addresses)
        .collect();
    assert!(listening.len() >= 3, "dashboard, viewers, and the server behind them: {listening:?}");
    assert!(listening.iter().all(|address| address.starts_with("127.")), "{listening:?}");
    watched.live.quit().assert_balanced();
}

#[test]
fn run_refuses_a_public_address_without_a_token_and_other_unusable_monitor_settings() {
    let bench = Bench::with_changes(&[("enabled = false", "address = \"0.0.0.0:0\"")]);
    bench.assert_refused(
        &[&"run", &"--config", &bench.configuration()],
        &["scanner.toml", "monitor.token_file", "16 characters"],
    );
    let bench = Bench::with_changes(&[("enabled = false", "token_file = \"nothing\"")]);
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["nothing", "cannot be read"]);
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let bench = Bench::with_changes(&[("enabled = false", &format!("address = \"{address}\""))]);
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["monitor.address", &address]);
}

/// Returns the addresses that a process listens on: TCP and UDP, IPv4 and IPv6.
fn listening_addresses(pid: u32) -> Vec<String> {
    let inodes: Vec<String> = std::fs::read_dir(format!("/proc/{pid}/fd"))
        .unwrap()
        .flatten()
        .filter_map(|entry| {
            let target = std::fs::read_link(entry.path()).ok()?;
            Some(target.to_str()?.strip_prefix("socket:[")?.trim_end_matches(']').to_owned())
        })
        .collect();
    let mut found = Vec::new();
    for (table, state) in [("tcp", Some("0A")), ("tcp6", Some("0A")), ("udp", None), ("udp6", None)] {
        let text = std::fs::read_to_string(format!("/proc/{pid}/net/{table}")).unwrap_or_default();
        for line in text.lines().skip(1) {
            let fields: Vec<&str> = line.split_ascii_whitespace().collect();
            if inodes.iter().any(|inode| inode == fields[9]) && state.is_none_or(|state| fields[3] == state) {
                found.push(parse_address(fields[1]));
            }
        }
    }
    found
}

/// Parses an address of `/proc/net`. IPv4 addresses are in the byte order of the machine. IPv6 addresses, which no test
/// expects, stay as they are.
fn parse_address(field: &str) -> String {
    let (host, port) = field.split_once(':').unwrap();
    let port = u16::from_str_radix(port, 16).unwrap();
    match u32::from_str_radix(host, 16) {
        Ok(bytes) if host.len() == 8 => format!("{}:{port}", std::net::Ipv4Addr::from(bytes.to_le_bytes())),
        _ => format!("[{host}]:{port}"),
    }
}
