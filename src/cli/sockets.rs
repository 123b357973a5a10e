//! The addresses on which `hbot server` listens.

use std::fmt::Display;
use std::io::ErrorKind;
use std::net::{SocketAddr, ToSocketAddrs as _};

use anyhow::{anyhow, bail};
use hbot_config::rig::ApiConfig;
use hbot_server::web::DEFAULT_WEB_PORT;
use tokio::net::TcpListener;

/// Returns the address and the port that a text names, by numbers or by the name of a machine. Of
/// several addresses of a name, one of IPv4 comes first, as clients try it.
fn named(text: &str) -> Option<SocketAddr> {
    if let Ok(address) = text.parse() {
        return Some(address);
    }
    text.rsplit_once(':').filter(|(name, _)| !name.is_empty() && !name.contains([':', '/']))?;
    let all: Vec<SocketAddr> = text.to_socket_addrs().ok()?.collect();
    all.iter().find(|address| address.is_ipv4()).or(all.first()).copied()
}

/// Parses an address with a port.
pub(crate) fn address(text: &str) -> Result<SocketAddr, String> {
    named(text).ok_or_else(|| {
        let guess = text.parse::<u16>().map(|port| format!("127.0.0.1:{port}"));
        format!(
            "an address with a port, such as {}",
            guess.unwrap_or_else(|_| "127.0.0.1:4268 or [::1]:4268".to_owned())
        )
    })
}

/// Returns a socket that listens on `at`, for the command line's `option`. An error states the
/// reason and how to correct it.
pub(crate) async fn bind(at: SocketAddr, option: &str) -> anyhow::Result<TcpListener> {
    TcpListener::bind(at)
        .await
        .map_err(|error| anyhow!("{}", cannot_listen(at, option, error.kind(), &error)))
}

/// Returns a socket and its address, if the option is given.
pub(crate) async fn bind_if(
    at: Option<SocketAddr>,
    option: &str,
) -> anyhow::Result<Option<(TcpListener, SocketAddr)>> {
    let Some(at) = at else { return Ok(None) };
    let listener = bind(at, option).await?;
    let at = listener.local_addr()?;
    Ok(Some((listener, at)))
}

/// Where the page for browsers is served.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Web {
    Off,
    At(SocketAddr),
}

/// Parses an address with a port, or `off`.
pub(crate) fn web(text: &str) -> Result<Web, String> {
    if text == "off" {
        return Ok(Web::Off);
    }
    let guess =
        text.parse::<u16>().map_or_else(|_| "127.0.0.1:4269".to_owned(), |port| format!("127.0.0.1:{port}"));
    named(text).map(Web::At).ok_or_else(|| format!("an address with a port, such as {guess}, or off"))
}

/// Parses a name of this machine.
pub(crate) fn host_name(text: &str) -> Result<String, String> {
    let legal = |byte: u8| byte.is_ascii_alphanumeric() || b".-_:[]".contains(&byte);
    let is_address = text.starts_with('[') && text.ends_with(']');
    if text.is_empty() || !text.bytes().all(legal) || (text.contains([':', '[', ']']) && !is_address) {
        return Err("a name without a scheme and a port, such as rig.local or [fd00::5]".to_owned());
    }
    Ok(text.to_owned())
}

/// Returns the socket of the web port and its address, if the page is served: at `wanted`, or
/// otherwise at the default address if the rig is `simulated`. If the default address is in use,
/// the page is not served, and a notice says so.
///
/// # Errors
/// Fails if the address that was asked for cannot be used, or if other machines reach it without a
/// token and encryption.
pub(crate) async fn bind_web(
    wanted: Option<Web>,
    simulated: bool,
    api: &ApiConfig,
) -> anyhow::Result<(Option<(TcpListener, SocketAddr)>, Option<String>)> {
    let default = SocketAddr::from(([127, 0, 0, 1], DEFAULT_WEB_PORT));
    match wanted {
        Some(Web::At(at)) => {
            let open = api.token_file.is_none() || api.tls.is_none();
            if open && !at.ip().is_loopback() {
                bail!(
                    "--web {at} lets other machines in: name a file with a token by --token-file and set api.tls in the \
                     rig file (docs/websocket.md)"
                );
            }
            Ok((bind_if(Some(at), "--web").await?, None))
        }
        None if simulated => match TcpListener::bind(default).await {
            Ok(listener) => Ok((Some((listener, default)), None)),
            Err(error) => {
                let why = format!(
                    "no page is served: {default} is not free ({error}); `--web 127.0.0.1:0` takes a free port"
                );
                Ok((None, Some(why)))
            }
        },
        Some(Web::Off) | None => Ok((None, None)),
    }
}

fn cannot_listen(at: SocketAddr, option: &str, kind: ErrorKind, why: &dyn Display) -> String {
    let free = format!("`{option} {}:0` takes a free port", at.ip());
    let what = match kind {
        ErrorKind::AddrInUse => format!("is another hbot server running there? {free}"),
        ErrorKind::PermissionDenied => {
            format!("the system does not let this user have the port; those below 1024 need a right. {free}")
        }
        ErrorKind::AddrNotAvailable => "this machine does not have the address".to_owned(),
        _ => free,
    };
    format!("cannot listen on {at} ({why}): {what}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_hinders_a_socket_is_named() {
        let said = |kind| cannot_listen(SocketAddr::from(([127, 0, 0, 1], 80)), "--listen", kind, &"why");
        assert!(said(ErrorKind::AddrInUse).contains("another hbot server"));
        let denied = said(ErrorKind::PermissionDenied);
        assert!(denied.contains("below 1024 need a right") && !denied.contains("another"), "{denied}");
        assert!(said(ErrorKind::AddrNotAvailable).contains("does not have the address"));
    }
}
