//! Decides which requests are answered, by host, origin and token.

use std::io;
use std::net::IpAddr;
use std::path::PathBuf;

use http::header::{AUTHORIZATION, COOKIE, HOST, ORIGIN};
use http::{HeaderMap, HeaderName, StatusCode, Uri};

use fringeflow_config::MonitorConfiguration;

/// Name of the cookie that holds the token.
pub(crate) const COOKIE_NAME: &str = "fringeflow_token";
/// Fewest characters of a token.
const MIN_TOKEN_LENGTH: usize = 16;

/// Checks the heads of requests.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    /// Further names of this machine, in lower case.
    host_names: Vec<String>,
    /// Origins of foreign pages that may connect as viewers.
    viewer_origins: Vec<String>,
    token: Option<String>,
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The host name is missing or foreign, for example because a foreign name was made to resolve to this address.
    Host,
    /// A page of another origin sent it.
    Origin,
    /// The token is missing or wrong.
    Token,
}

/// A token that cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TokenError {
    #[error("{}: the monitor's token cannot be read: {source}", file.display())]
    Unreadable { file: PathBuf, source: io::Error },
    #[error("{}: the monitor's token must have at least {MIN_TOKEN_LENGTH} letters, digits, - or _; make one with: openssl rand -hex 16", file.display())]
    Invalid { file: PathBuf },
}

impl Refusal {
    pub(crate) fn status(self) -> StatusCode {
        match self {
            Self::Host => StatusCode::MISDIRECTED_REQUEST,
            Self::Origin => StatusCode::FORBIDDEN,
            Self::Token => StatusCode::UNAUTHORIZED,
        }
    }

    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Host => {
                "This server does not answer under that host name; use its address, or name it in monitor.host_names.\n"
            }
            Self::Origin => "Pages of other origins may not connect here.\n",
            Self::Token => {
                "A token is needed: open the page as /?token=TOKEN, or send the header Authorization: Bearer TOKEN.\n"
            }
        }
    }
}

impl Guard {
    /// Builds the guard that a configuration describes, and reads its token file.
    pub(crate) fn new(configuration: &MonitorConfiguration) -> Result<Self, TokenError> {
        Ok(Self {
            host_names: configuration.host_names.iter().map(|name| name.to_ascii_lowercase()).collect(),
            viewer_origins: configuration.foxglove_origins.clone(),
            token: configuration.token_file.as_ref().map(read_token).transpose()?,
        })
    }

    /// Checks the head of a request to the page. `local` is the address of this machine that it arrived at.
    pub(crate) fn check_page(&self, headers: &HeaderMap, uri: &Uri, local: IpAddr) -> Result<(), Refusal> {
        let host = self.check_host(headers, local)?;
        let is_own = |origin: &str| origin.strip_prefix("http://") == Some(host);
        if !single_value(headers, &ORIGIN)?.is_none_or(is_own) {
            return Err(Refusal::Origin);
        }
        self.check_token(headers, uri)
    }

    /// Checks the head of a viewer's request. Viewers are pages of other origins, or programs without an origin.
    pub(crate) fn check_viewer(&self, headers: &HeaderMap, uri: &Uri, local: IpAddr) -> Result<(), Refusal> {
        self.check_host(headers, local)?;
        let is_known = |origin: &str| {
            let host = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            let is_here = host.is_some_and(|host| is_loopback_name(without_port(host)));
            is_here || origin == "file://" || self.viewer_origins.iter().any(|known| known == origin)
        };
        if !single_value(headers, &ORIGIN)?.is_none_or(is_known) {
            return Err(Refusal::Origin);
        }
        self.check_token(headers, uri)
    }

    /// Returns the token of a query such as `?token=T` if it is valid.
    pub(crate) fn token_of_query<'u>(&self, uri: &'u Uri) -> Option<&'u str> {
        let query = uri.query()?.split('&').find_map(|pair| pair.strip_prefix("token="))?;
        self.is_token(query).then_some(query)
    }

    /// Checks that the host is an address or a name of this machine, and returns it.
    fn check_host<'h>(&self, headers: &'h HeaderMap, local: IpAddr) -> Result<&'h str, Refusal> {
        let host = single_value(headers, &HOST).ok().flatten().ok_or(Refusal::Host)?;
        let name = without_port(host).to_ascii_lowercase();
        let is_local = name.trim_matches(['[', ']']).parse() == Ok(local);
        let is_known = is_local || (local.is_loopback() && is_loopback_name(&name)) || self.host_names.contains(&name);
        is_known.then_some(host).ok_or(Refusal::Host)
    }

    fn check_token(&self, headers: &HeaderMap, uri: &Uri) -> Result<(), Refusal> {
        if self.token.is_none() {
            return Ok(());
        }
        let bearer = single_value(headers, &AUTHORIZATION)?.and_then(|value| value.strip_prefix("Bearer "));
        let cookies = single_value(headers, &COOKIE)?.unwrap_or_default().split(';').map(str::trim);
        let cookie = cookies.filter_map(|cookie| cookie.split_once('=')).find(|(name, _)| *name == COOKIE_NAME);
        let given = [bearer, cookie.map(|(_, token)| token)];
        let is_right =
            given.into_iter().flatten().any(|token| self.is_token(token)) || self.token_of_query(uri).is_some();
        is_right.then_some(()).ok_or(Refusal::Token)
    }

    /// Whether the text is the token. The time this takes does not reveal how many characters match.
    fn is_token(&self, given: &str) -> bool {
        let Some(token) = &self.token else { return false };
        let pairs = token.bytes().zip(given.bytes().chain(std::iter::repeat(0)));
        let difference = pairs.fold(0, |difference, (a, b)| difference | (a ^ b));
        difference == 0 && token.len() == given.len()
    }
}

/// Returns the value of a header that may occur once; `None` if it is missing.
fn single_value<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Result<Option<&'h str>, Refusal> {
    let mut values = headers.get_all(name).iter();
    match (values.next(), values.next()) {
        (None, _) => Ok(None),
        (Some(value), None) => value.to_str().map(Some).map_err(|_| Refusal::Origin),
        (Some(_), Some(_)) => Err(Refusal::Origin),
    }
}

/// A host without the port behind it.
fn without_port(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) && !name.is_empty() => name,
        _ => host,
    }
}

fn is_loopback_name(name: &str) -> bool {
    name == "localhost" || name.trim_matches(['[', ']']).parse().is_ok_and(|address: IpAddr| address.is_loopback())
}

fn read_token(file: &PathBuf) -> Result<String, TokenError> {
    let text = std::fs::read_to_string(file).map_err(|source| TokenError::Unreadable { file: file.clone(), source })?;
    let token = text.trim();
    let is_plain = token.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_'));
    if token.len() < MIN_TOKEN_LENGTH || !is_plain {
        return Err(TokenError::Invalid { file: file.clone() });
    }
    Ok(token.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOPBACK: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);
    const TOKEN: &str = "0123456789abcdef";

    fn guard(token: Option<&str>) -> Guard {
        Guard {
            host_names: vec!["scanner.local".to_owned()],
            viewer_origins: vec!["https://app.foxglove.dev".to_owned()],
            token: token.map(str::to_owned),
        }
    }

    fn headers(pairs: &[(HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect()
    }

    fn page(guard: &Guard, pairs: &[(HeaderName, &str)], path: &str) -> Result<(), Refusal> {
        guard.check_page(&headers(pairs), &path.parse().unwrap(), LOOPBACK)
    }

    #[test]
    fn only_names_of_this_machine_are_accepted() {
        let guard = guard(None);
        for host in ["127.0.0.1:8780", "localhost:8780", "LOCALHOST", "[::1]:8780", "scanner.local:8780"] {
            assert_eq!(page(&guard, &[(HOST, host)], "/"), Ok(()), "{host}");
        }
        for host in
            ["evil.example", "evil.example:8780", "127.0.0.1.evil.example", "192.168.1.7:8780", "", ":8780", "[::1"]
        {
            assert_eq!(page(&guard, &[(HOST, host)], "/"), Err(Refusal::Host), "{host}");
        }
        assert_eq!(page(&guard, &[], "/"), Err(Refusal::Host));
        assert_eq!(page(&guard, &[(HOST, "localhost"), (HOST, "evil.example")], "/"), Err(Refusal::Host));
    }

    #[test]
    fn another_address_is_accepted_if_the_request_arrived_there() {
        let other: IpAddr = "192.168.1.7".parse().unwrap();
        let check = |host| guard(None).check_page(&headers(&[(HOST, host)]), &"/".parse().unwrap(), other);
        assert_eq!(check("192.168.1.7:8780"), Ok(()));
        assert_eq!(check("localhost:8780"), Err(Refusal::Host));
    }

    #[test]
    fn pages_of_other_origins_are_refused_except_known_viewers() {
        let guard = guard(None);
        let both = |origin| {
            let headers = headers(&[(HOST, "localhost:8780"), (ORIGIN, origin)]);
            let uri = "/".parse().unwrap();
            [guard.check_page(&headers, &uri, LOOPBACK), guard.check_viewer(&headers, &uri, LOOPBACK)]
                .map(|r| r.is_ok())
        };
        assert_eq!(both("http://localhost:8780"), [true, true]);
        assert_eq!(both("http://localhost:9999"), [false, true]);
        assert_eq!(both("https://app.foxglove.dev"), [false, true]);
        assert_eq!(both("file://"), [false, true]);
        for foreign in
            ["https://evil.example", "null", "https://app.foxglove.dev.evil.example", "http://localhost.evil.example"]
        {
            assert_eq!(both(foreign), [false, false], "{foreign}");
        }
    }

    #[test]
    fn a_token_is_accepted_as_bearer_cookie_or_query() {
        let guard = guard(Some(TOKEN));
        let host = (HOST, "localhost");
        let only_host = std::slice::from_ref(&host);
        let bearer = format!("Bearer {TOKEN}");
        let cookie = format!("theme=dark; {COOKIE_NAME}={TOKEN}");
        assert_eq!(page(&guard, &[host.clone(), (AUTHORIZATION, &bearer)], "/"), Ok(()));
        assert_eq!(page(&guard, &[host.clone(), (COOKIE, &cookie)], "/"), Ok(()));
        assert_eq!(page(&guard, only_host, &format!("/?token={TOKEN}")), Ok(()));
        assert_eq!(page(&guard, only_host, "/"), Err(Refusal::Token));
        assert_eq!(page(&guard, only_host, "/?token=0123456789abcdeg"), Err(Refusal::Token));
        assert_eq!(page(&guard, only_host, &format!("/?token={TOKEN}0")), Err(Refusal::Token));
        assert_eq!(page(&guard, &[host.clone(), (AUTHORIZATION, "Bearer ")], "/"), Err(Refusal::Token));
    }

    #[test]
    fn short_tokens_and_other_characters_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        assert!(read_token(&file).unwrap_err().to_string().contains("cannot be read"));
        for invalid in ["short", "0123456789abcde\n", "0123456789 abcdef"] {
            std::fs::write(&file, invalid).unwrap();
            assert!(matches!(read_token(&file), Err(TokenError::Invalid { .. })), "{invalid}");
        }
        std::fs::write(&file, format!("{TOKEN}\n")).unwrap();
        assert_eq!(read_token(&file).unwrap(), TOKEN);
    }
}
