//! Decides which web pages may talk to this server, by the headers Host and Origin.
//!
//! Every web page that a browser shows can send requests to addresses of this machine. The browser
//! says in Origin from where the page came. It says in Host which name the page used; a page whose
//! name is redirected to this machine (DNS rebinding) has its own name in both. So both are
//! compared with the names of this server, and never with each other.

use std::net::{IpAddr, SocketAddr};

use tungstenite::handshake::server::Request;
use tungstenite::http::{HeaderName, StatusCode, header};

use super::head::Refusal;

/// Names of this machine, apart from addresses, that are always allowed.
const LOOPBACK: [&str; 3] = ["localhost", "127.0.0.1", "[::1]"];

/// Names by which browsers may reach a server, in addition to `localhost` and its address.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AllowedHosts(Vec<String>);

impl AllowedHosts {
    /// Creates a list of additional names, without ports. A page of such a name is allowed
    /// whatever port and scheme it has.
    #[must_use]
    pub fn new(names: impl IntoIterator<Item = String>) -> Self {
        Self(names.into_iter().map(|name| name.to_ascii_lowercase()).collect())
    }
}

/// One connection to a web port, and what its requests may be.
#[derive(Debug, Clone)]
pub(crate) struct Door<'a> {
    /// The additional names of this server.
    pub(crate) hosts: &'a AllowedHosts,
    /// The address of this machine at which the connection arrived.
    pub(crate) at: SocketAddr,
    /// True if the connection is encrypted.
    pub(crate) encrypted: bool,
    /// True if a WebSocket may have no Origin. Browsers always send one.
    pub(crate) without_origin: bool,
}

impl Door<'_> {
    /// Checks the headers Host, and Origin if there is one.
    ///
    /// # Errors
    /// Fails with the refusal to answer.
    pub(crate) fn check(&self, request: &Request) -> Result<(), Refusal> {
        if request.uri().authority().is_some() {
            return Err(Refusal::new(StatusCode::BAD_REQUEST, "a request names a path here, not an address"));
        }
        match single(request, &header::HOST)? {
            Some(host) if self.is_host(host) => {}
            Some(host) => {
                let why = format!(
                    "the header Host is {host:?}, which is no name of this server; legal: its address, localhost with its \
                     port, or a name given by --allowed-host"
                );
                return Err(Refusal::new(StatusCode::FORBIDDEN, why));
            }
            None => return Err(Refusal::new(StatusCode::BAD_REQUEST, "the header Host is missing")),
        }
        match single(request, &header::ORIGIN)? {
            Some(origin) if !self.is_origin(origin) => {
                let why = format!(
                    "the header Origin is {origin:?}: pages from there may not talk to this server; legal: its own page, \
                     or a name given by --allowed-host"
                );
                Err(Refusal::new(StatusCode::FORBIDDEN, why))
            }
            _ => Ok(()),
        }
    }

    /// Checks that a request for a WebSocket has an Origin, if this server asks for one.
    ///
    /// # Errors
    /// Fails with the refusal to answer.
    pub(crate) fn check_origin(&self, request: &Request) -> Result<(), Refusal> {
        if self.without_origin || request.headers().contains_key(header::ORIGIN) {
            return Ok(());
        }
        let why = format!(
            "the header Origin is missing: a program that is no browser sends {}://{}, or the server has a token",
            self.scheme(),
            self.at
        );
        Err(Refusal::new(StatusCode::FORBIDDEN, why))
    }

    const fn scheme(&self) -> &'static str {
        if self.encrypted { "https" } else { "http" }
    }

    fn is_host(&self, host: &str) -> bool {
        let (name, port) = split(host);
        if self.is_additional(name) {
            return true;
        }
        let default = if self.encrypted { 443 } else { 80 };
        let port = port.map_or(Some(default), |port| port.parse().ok());
        port == Some(self.at.port()) && self.is_own(name)
    }

    fn is_origin(&self, origin: &str) -> bool {
        let Some((scheme, host)) = origin.split_once("://") else { return false };
        if ["http", "https"].contains(&scheme) && self.is_additional(split(host).0) {
            return true;
        }
        scheme == self.scheme() && self.is_host(host)
    }

    fn is_additional(&self, name: &str) -> bool {
        self.hosts.0.iter().any(|allowed| name.eq_ignore_ascii_case(allowed))
    }

    /// Returns whether `name` is a loopback name, or the address at which the connection arrived.
    fn is_own(&self, name: &str) -> bool {
        let address = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        LOOPBACK.iter().any(|own| name.eq_ignore_ascii_case(own))
            || address.parse::<IpAddr>().is_ok_and(|ip| ip.to_canonical() == self.at.ip().to_canonical())
    }
}

/// Splits `name:port`. The name of an IPv6 address is in brackets.
fn split(host: &str) -> (&str, Option<&str>) {
    match host.rsplit_once(':') {
        Some((name, port)) if !port.ends_with(']') => (name, Some(port)),
        _ => (host, None),
    }
}

/// Returns the value of a header. Refuses a request that has the header twice or not as text.
fn single<'a>(request: &'a Request, name: &HeaderName) -> Result<Option<&'a str>, Refusal> {
    let mut values = request.headers().get_all(name).iter();
    let Some(value) = values.next() else { return Ok(None) };
    match (value.to_str(), values.next()) {
        (Ok(text), None) => Ok(Some(text)),
        _ => Err(Refusal::new(StatusCode::BAD_REQUEST, format!("the header {name} is legal once, as text"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(host: Option<&str>, origin: Option<&str>) -> Request {
        let mut request = tungstenite::http::Request::builder().uri("/ws");
        if let Some(host) = host {
            request = request.header("Host", host);
        }
        if let Some(origin) = origin {
            request = request.header("Origin", origin);
        }
        request.body(()).unwrap()
    }

    fn door(hosts: &AllowedHosts) -> Door<'_> {
        Door { hosts, at: "127.0.0.1:4269".parse().unwrap(), encrypted: false, without_origin: false }
    }

    fn status(door: &Door<'_>, host: Option<&str>, origin: Option<&str>) -> u16 {
        let request = request(host, origin);
        let checked = door.check(&request).and_then(|()| door.check_origin(&request));
        checked.err().map_or(101, |refusal| refusal.status.as_u16())
    }

    #[test]
    fn a_name_of_this_server_is_allowed_and_no_other() {
        let none = AllowedHosts::default();
        let own = Some("http://localhost:4269");
        for host in
            ["localhost:4269", "LOCALHOST:4269", "127.0.0.1:4269", "[::1]:4269", "[::ffff:127.0.0.1]:4269"]
        {
            assert_eq!(status(&door(&none), Some(host), own), 101, "{host}");
        }
        for host in [
            "evil.example:4269",
            "evil.example",
            "localhost",
            "localhost:4268",
            "localhost:",
            "localhost:04269x",
            "localhost.evil.example:4269",
            "192.168.1.5:4269",
            "127.0.0.1:4269@evil.example",
            "[::1]",
            "[::1",
            "",
            ":4269",
        ] {
            assert_eq!(status(&door(&none), Some(host), own), 403, "{host}");
        }
        assert_eq!(status(&door(&none), None, own), 400);
    }

    #[test]
    fn a_page_from_elsewhere_is_refused_even_if_its_name_leads_here() {
        let none = AllowedHosts::default();
        for origin in [
            "http://evil.example",
            "https://evil.example",
            "http://evil.example:4269",
            "http://localhost",
            "http://localhost:8080",
            "https://localhost:4269",
            "ws://localhost:4269",
            "file://",
            "null",
            "",
            "localhost:4269",
        ] {
            assert_eq!(status(&door(&none), Some("localhost:4269"), Some(origin)), 403, "{origin}");
        }
        // A rebound name: Origin equals Host.
        assert_eq!(status(&door(&none), Some("evil.example:4269"), Some("http://evil.example:4269")), 403);
        for origin in ["http://localhost:4269", "http://127.0.0.1:4269", "http://[::1]:4269"] {
            assert_eq!(status(&door(&none), Some("localhost:4269"), Some(origin)), 101, "{origin}");
        }
    }

    #[test]
    fn a_missing_origin_needs_a_server_with_a_token() {
        let none = AllowedHosts::default();
        assert_eq!(status(&door(&none), Some("localhost:4269"), None), 403);
        let lenient = Door { without_origin: true, ..door(&none) };
        assert_eq!(status(&lenient, Some("localhost:4269"), None), 101);
        assert_eq!(status(&lenient, Some("localhost:4269"), Some("http://evil.example")), 403);
    }

    #[test]
    fn a_header_that_is_there_twice_is_refused() {
        let none = AllowedHosts::default();
        for name in ["Host", "Origin"] {
            let mut twice = request(Some("localhost:4269"), Some("http://localhost:4269"));
            twice.headers_mut().append(name, "evil.example".parse().unwrap());
            assert_eq!(door(&none).check(&twice).unwrap_err().status.as_u16(), 400, "{name}");
        }
        let mut elsewhere = request(Some("localhost:4269"), None);
        *elsewhere.uri_mut() = "http://evil.example/ws".parse().unwrap();
        assert_eq!(door(&none).check(&elsewhere).unwrap_err().status.as_u16(), 400);
    }

    #[test]
    fn names_that_were_given_are_allowed_with_any_port() {
        let hosts = AllowedHosts::new(["Rig.local".to_owned()]);
        let at: SocketAddr = "192.168.1.5:4269".parse().unwrap();
        let there = Door { at, encrypted: true, ..door(&hosts) };
        for (host, origin) in [
            ("rig.local:4269", "https://rig.local:4269"),
            ("rig.local", "https://rig.local"),
            ("192.168.1.5:4269", "https://192.168.1.5:4269"),
        ] {
            assert_eq!(status(&there, Some(host), Some(origin)), 101, "{host}");
        }
        for (host, origin) in [
            ("192.168.1.6:4269", "https://rig.local:4269"),
            ("rig.local.evil:4269", "https://rig.local:4269"),
            ("rig.local:4269", "https://evil.example"),
            ("rig.local:4269", "http://192.168.1.5:4269"),
        ] {
            assert_eq!(status(&there, Some(host), Some(origin)), 403, "{host} {origin}");
        }
    }
}
