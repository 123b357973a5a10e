//! Reads tokens from files, and warns about weak secrets before a server starts.

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

use anyhow::{Context as _, bail};
use hbot_config::RigConfig;

/// Smallest length of a token, characters.
const MIN_TOKEN: usize = 16;

/// Reads the token from a file.
fn read(file: &Path) -> anyhow::Result<String> {
    let text = hbot_config::read_text(file).with_context(|| format!("token file {}", file.display()))?;
    let token = text.trim();
    if token.len() < MIN_TOKEN {
        bail!(
            "token file {}: a token has at least {MIN_TOKEN} characters; this one has {}",
            file.display(),
            token.len()
        );
    }
    Ok(token.to_owned())
}

/// Returns the token that clients must present, or `None` if only clients on this machine are
/// allowed.
pub(crate) fn token(rig: &RigConfig) -> anyhow::Result<Option<String>> {
    if rig.api.needs_token() && rig.api.token_file.is_none() {
        bail!(
            "listening on {} lets other machines in: name a file with a token by --token-file (or api.token_file)",
            rig.api.listen
        );
    }
    rig.api.token_file.as_deref().map(read).transpose()
}

/// Returns the token that a request for metrics must present. It travels over the network without
/// encryption, so it must differ from `commanding`, the token of clients.
pub(crate) fn metrics_token(
    at: std::net::SocketAddr,
    file: Option<&Path>,
    commanding: Option<&str>,
) -> anyhow::Result<Option<String>> {
    let Some(file) = file else {
        if !at.ip().is_loopback() {
            bail!(
                "--metrics {at} lets other machines in: name a file with a token for the page alone by --metrics-token-file"
            );
        }
        return Ok(None);
    };
    let token = read(file)?;
    if commanding == Some(token.as_str()) {
        bail!(
            "--metrics-token-file {}: the same token as that of clients, and the page sends it unencrypted: make another one",
            file.display()
        );
    }
    Ok(Some(token))
}

/// Returns notices about weak secrets that do not prevent the server from starting.
pub(crate) fn notices(rig: &RigConfig, metrics_token_file: Option<&Path>) -> Vec<String> {
    let mut notices = Vec::new();
    if rig.api.needs_token() && rig.api.tls.is_none() {
        notices.push(format!(
            "the token of clients goes unencrypted over the network to {}: set api.tls in the rig file (docs/api.md, Encryption)",
            rig.api.listen
        ));
    }
    let key = rig.api.tls.as_ref().map(|tls| tls.key.as_path());
    for file in [rig.api.token_file.as_deref(), metrics_token_file, key].into_iter().flatten() {
        // A file that cannot be examined is reported elsewhere and stops the start.
        if std::fs::metadata(file).is_ok_and(|found| found.permissions().mode() & 0o004 != 0) {
            let file = file.display();
            notices
                .push(format!("every user of this machine may read the secret in {file}: chmod 600 {file}"));
        }
    }
    notices
}

/// Returns a notice if live viewers on other machines can connect to the address `at`.
pub(crate) fn live_notice(at: std::net::SocketAddr) -> Option<String> {
    (!at.ip().is_loopback()).then(|| {
        format!("whoever reaches {at} sees everything that this rig does, unencrypted and without a token")
    })
}

#[cfg(test)]
mod tests {
    use std::fs::Permissions;
    use std::net::SocketAddr;

    use super::*;

    const HERE: SocketAddr = SocketAddr::V4(std::net::SocketAddrV4::new(std::net::Ipv4Addr::LOCALHOST, 0));
    const ANYWHERE: SocketAddr =
        SocketAddr::V4(std::net::SocketAddrV4::new(std::net::Ipv4Addr::UNSPECIFIED, 0));

    #[test]
    fn the_page_of_metrics_has_a_token_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        std::fs::write(&file, "of sixteen bytes and more\n").unwrap();
        assert_eq!(metrics_token(HERE, None, None).unwrap(), None);
        let error = metrics_token(ANYWHERE, None, Some("of clients")).unwrap_err().to_string();
        assert!(error.contains("--metrics-token-file"), "{error}");
        for at in [HERE, ANYWHERE] {
            let token = metrics_token(at, Some(&file), Some("of clients")).unwrap();
            assert_eq!(token.as_deref(), Some("of sixteen bytes and more"));
            let error = metrics_token(at, Some(&file), token.as_deref()).unwrap_err().to_string();
            assert!(error.contains("the same token"), "{error}");
        }
    }

    #[test]
    fn live_viewers_from_other_machines_are_told() {
        assert_eq!(live_notice(HERE), None);
        assert!(live_notice(ANYWHERE).is_some_and(|told| told.contains("without a token")));
    }

    #[test]
    fn what_is_weak_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        std::fs::write(&file, "of sixteen bytes and more").unwrap();
        let mut rig = RigConfig::prototype();
        rig.api.token_file = Some(file.clone());
        std::fs::set_permissions(&file, Permissions::from_mode(0o640)).unwrap();
        assert_eq!(notices(&rig, Some(&file)), [""; 0]);
        std::fs::set_permissions(&file, Permissions::from_mode(0o644)).unwrap();
        let told = notices(&rig, None);
        assert!(told.len() == 1 && told[0].contains("chmod 600") && told[0].contains("token"), "{told:?}");
        rig.api.token_file = None;
        rig.api.listen = ANYWHERE;
        let told = notices(&rig, None);
        assert!(told.len() == 1 && told[0].contains("unencrypted"), "{told:?}");
    }
}
