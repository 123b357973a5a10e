//! The addresses on which `hbot server` listens.

use std::io::ErrorKind;
use std::net::SocketAddr;

use tokio::net::TcpListener;

/// Parses an address with a port.
pub(crate) fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| {
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
    TcpListener::bind(at).await.map_err(|error| {
        let what = cannot_listen(at, option, error.kind());
        anyhow::Error::from(error).context(what)
    })
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

fn cannot_listen(at: SocketAddr, option: &str, kind: ErrorKind) -> String {
    let free = format!("`{option} {}:0` takes a free port", at.ip());
    let what = match kind {
        ErrorKind::AddrInUse => format!("is another hbot server running there? {free}"),
        ErrorKind::PermissionDenied => {
            format!("the system does not let this user have the port; those below 1024 need a right. {free}")
        }
        ErrorKind::AddrNotAvailable => "this machine does not have the address".to_owned(),
        _ => free,
    };
    format!("cannot listen on {at}: {what}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_hinders_a_socket_is_named() {
        let said = |kind| cannot_listen(SocketAddr::from(([127, 0, 0, 1], 80)), "--listen", kind);
        assert!(said(ErrorKind::AddrInUse).contains("another hbot server"));
        let denied = said(ErrorKind::PermissionDenied);
        assert!(denied.contains("below 1024 need a right") && !denied.contains("another"), "{denied}");
        assert!(said(ErrorKind::AddrNotAvailable).contains("does not have the address"));
    }
}
