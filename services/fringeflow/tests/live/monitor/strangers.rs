//! Who has no business here: refused or bounded, and nobody else is reached.

use std::time::Instant;

use super::*;

/// Connections of the stranger that opens too many.
const CONNECTIONS: usize = 1000;
/// Of these, more than the server serves at once.
const SERVED: usize = 256;

#[test]
fn foreign_names_and_origins_are_refused() {
    let bench = bench("");
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
    // What a form or a script without permission can send.
    for media_type in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"] {
        assert_eq!(watched.request("POST", "/control", &[("Content-Type", media_type)], command).status, 415);
    }
    assert_eq!(watched.figures()["state"]["scanning"], true);
    watched.live.quit().assert_balanced();
}

#[test]
fn odd_requests_are_refused_and_the_server_lives_on() {
    let bench = bench("");
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
fn slow_heads_are_cut_off_and_a_thousand_connections_are_bounded() {
    let bench = bench("");
    let watched = Watched::start(&bench, &[]);
    let mut slow = watched.connect();
    slow.write_all(b"GET /figures HTTP/1.1\r\nHost:").unwrap();
    let begin = Instant::now();
    // A byte now and then does not buy more time.
    slow.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
    let is_cut = |stream: &mut TcpStream| {
        let is_open = |result: std::io::Result<usize>| matches!(&result, Err(error) if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut));
        stream.write_all(b" ").is_err() || !is_open(stream.read(&mut [0; 256]))
    };
    while !is_cut(&mut slow) {
        assert!(begin.elapsed() < PATIENCE, "a slow head is waited for without end");
    }
    let mut held: Vec<TcpStream> = (0..CONNECTIONS).filter_map(|_| TcpStream::connect(watched.address).ok()).collect();
    let refused = |stream: &mut TcpStream| {
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        Answer::of(&answer).status == 503
    };
    assert!(held.len() > SERVED && held[SERVED..].iter_mut().any(refused), "{} connections were all taken", held.len());
    drop(held);
    watched.live.wait_until("the server answers again", || watched.get("/figures").status == 200);
    watched.live.wait_for_clouds(1);
    watched.live.quit().assert_balanced();
}

#[test]
fn a_token_is_asked_for_where_there_is_one() {
    let bench = bench("token_file = \"token\"\n");
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
fn nothing_but_this_machine_is_listened_to_by_default() {
    // As configured where nothing is said about the monitor.
    let bench = Bench::with(&[("[monitor]\nenabled = false\n", "")]);
    let watched = Watched::start(&bench, &[]);
    watched.live.wait_for_clouds(1);
    let monitor = bench.pid_of("monitor").unwrap();
    let listening: Vec<String> = crate::support::SERVICES
        .iter()
        .filter_map(|service| bench.pid_of(service))
        .chain([monitor, watched.live.pid()])
        .flat_map(listening)
        .collect();
    assert!(listening.len() >= 3, "dashboard, viewers, and the server behind: {listening:?}");
    assert!(listening.iter().all(|address| address.starts_with("127.")), "{listening:?}");
    watched.live.quit().assert_balanced();
}

#[test]
fn an_address_for_others_without_a_token_is_refused_before_anything_starts() {
    let bench = Bench::with(&[("enabled = false", "address = \"0.0.0.0:0\"")]);
    bench.refused(
        &[&"run", &"--config", &bench.configuration()],
        &["scanner.toml", "monitor.token_file", "16 characters"],
    );
    let bench = Bench::with(&[("enabled = false", "token_file = \"nothing\"")]);
    bench.refused(&[&"run", &"--config", &bench.configuration()], &["nothing", "cannot be read"]);
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let bench = Bench::with(&[("enabled = false", &format!("address = \"{address}\""))]);
    bench.refused(&[&"run", &"--config", &bench.configuration()], &["monitor.address", &address]);
}

/// Addresses that a process listens on, TCP of both kinds and UDP.
fn listening(pid: u32) -> Vec<String> {
    let own: Vec<String> = std::fs::read_dir(format!("/proc/{pid}/fd"))
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
            if own.iter().any(|inode| inode == fields[9]) && state.is_none_or(|state| fields[3] == state) {
                found.push(address(fields[1]));
            }
        }
    }
    found
}

/// An address as `/proc/net` writes it: four bytes in the order of the machine, or sixteen, which are never wanted here.
fn address(field: &str) -> String {
    let (host, port) = field.split_once(':').unwrap();
    let port = u16::from_str_radix(port, 16).unwrap();
    match u32::from_str_radix(host, 16) {
        Ok(bytes) if host.len() == 8 => format!("{}:{port}", std::net::Ipv4Addr::from(bytes.to_le_bytes())),
        _ => format!("[{host}]:{port}"),
    }
}
