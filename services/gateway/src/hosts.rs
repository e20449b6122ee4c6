//! What `Host` and `Origin` may say. A page of another site can have its name point at this machine (DNS
//! rebinding): the browser then sends that name as `Host` and as `Origin` alike, so each is held against a list.

use std::net::SocketAddr;

use axum::http::{HeaderMap, Uri, header};

use crate::problem::{Kind, Problem};

/// Names and addresses of this gateway, in lower case, without port.
#[derive(Clone, Debug)]
pub struct Hosts(Vec<String>);

impl Hosts {
    /// The address listened on, the names of loopback, and what the deployment adds.
    pub fn new(bind: SocketAddr, more: &[String]) -> Hosts {
        let mut list: Vec<String> = ["localhost", "127.0.0.1", "[::1]"].map(str::to_owned).into();
        if !bind.ip().is_unspecified() {
            list.push(host(&bind.to_string()).to_owned());
        }
        list.extend(more.iter().map(|name| name.to_ascii_lowercase()));
        Hosts(list)
    }

    /// Is the request meant for this gateway, and does it come from a page of its own?
    pub fn check(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Problem> {
        let mut named = headers.get_all(header::HOST).iter();
        // A target that names a host itself goes before the header (RFC 9112, 3.2.2).
        let authority = match (named.next(), named.next()) {
            (Some(_), Some(_)) => None,
            (one, _) => {
                uri.authority().map(|target| target.as_str()).or(one.and_then(|host| host.to_str().ok()))
            }
        };
        let Some(authority) = authority.filter(|authority| self.knows(host(authority))) else {
            let said = authority
                .map_or("is missing, double or unreadable".into(), |a| format!("= {a:?} is not known"));
            return Err(Problem::new(Kind::ForeignHost, format!("header Host {said}"))
                .hint(
                    "names beyond localhost and the address listened on stand in gateway.hosts of kort.toml",
                )
                .allowed(self.0.iter().cloned()));
        };
        let mut origins = headers.get_all(header::ORIGIN).iter();
        let Some(origin) = origins.next() else { return Ok(()) };
        let origin =
            if origins.next().is_some() { "two names" } else { origin.to_str().unwrap_or("unreadable") };
        let own = origin
            .strip_prefix("http://")
            .or_else(|| origin.strip_prefix("https://"))
            .is_some_and(|page| page.eq_ignore_ascii_case(authority) && self.knows(host(page)));
        if own {
            return Ok(());
        }
        Err(Problem::new(Kind::ForeignOrigin, format!("the request comes from a page of {origin}"))
            .hint("open the console of this gateway itself; programs need send no Origin"))
    }

    fn knows(&self, host: &str) -> bool {
        self.0.iter().any(|known| known.eq_ignore_ascii_case(host))
    }
}

/// An authority without its port.
fn host(authority: &str) -> &str {
    match authority.rsplit_once(':') {
        Some((host, port)) if port.bytes().all(|b| b.is_ascii_digit()) && !host.ends_with(':') => host,
        _ => authority,
    }
}

/// A name or address, without scheme, port or path.
pub fn is_host(text: &str) -> bool {
    let inner = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    match inner {
        Some(address) => address.parse::<std::net::Ipv6Addr>().is_ok(),
        None => {
            !text.is_empty()
                && text.len() < 254
                && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'.')
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(host: &str, origin: Option<&str>) -> Result<(), Problem> {
        let hosts = Hosts::new(SocketAddr::from(([127, 0, 0, 1], 8080)), &["Thruster.example.org".into()]);
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().unwrap());
        }
        hosts.check(&Uri::from_static("/"), &headers)
    }

    #[test]
    fn a_rebound_name_is_not_ours_though_host_and_origin_agree() {
        assert!(asked("evil.example:8080", Some("http://evil.example:8080")).is_err());
        assert!(asked("evil.example:8080", None).is_err());
        assert!(asked("localhost.evil.example", None).is_err());
        for host in ["localhost:8080", "127.0.0.1:8080", "[::1]:8080", "[::1]", "thruster.EXAMPLE.org"] {
            assert!(asked(host, None).is_ok(), "{host}");
            assert!(asked(host, Some(&format!("http://{host}"))).is_ok(), "{host}");
        }
    }

    #[test]
    fn a_target_that_names_another_host_is_foreign_whatever_the_header_says() {
        let hosts = Hosts::new(SocketAddr::from(([127, 0, 0, 1], 8080)), &[]);
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, "localhost:8080".parse().unwrap());
        let asked = |target: &'static str| hosts.check(&Uri::from_static(target), &headers);
        assert!(asked("http://evil.example/v1/stop").is_err());
        assert!(asked("http://127.0.0.1:8080/v1/stop").is_ok());
        assert!(asked("/v1/stop").is_ok());
    }

    #[test]
    fn a_page_of_another_port_or_site_is_foreign() {
        for origin in ["null", "http://localhost:3000", "http://evil.example", "file://localhost:8080"] {
            assert!(asked("localhost:8080", Some(origin)).is_err(), "{origin}");
        }
    }
}
