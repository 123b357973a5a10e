//! Stands in for `tls` in a build without the feature `tls`: a rig file that asks for encryption is
//! refused.

use hbot_config::rig::TlsFiles;
use thiserror::Error;
use tokio::net::TcpStream;

use crate::not_built::NotBuilt;

/// The reason why the files named in `[api] tls` of the rig file cannot be used.
#[derive(Debug, Error)]
#[error("api.tls: {0}")]
pub struct CertificateError(NotBuilt);

/// Encrypts connections with TLS. This build lacks the feature `tls`, so there is no value of this
/// type.
#[derive(Clone)]
pub enum Encryption {}

impl Encryption {
    /// Refuses, because this build has no encryption.
    ///
    /// # Errors
    /// Always fails. The error says how to build with encryption.
    pub fn from_files(_: &TlsFiles) -> Result<Self, CertificateError> {
        Err(CertificateError(NotBuilt { part: "encryption", feature: "tls" }))
    }

    /// Is never called, because there is no `Encryption`.
    pub(crate) async fn shake_hands(&self, _: TcpStream) -> std::io::Result<TcpStream> {
        match *self {}
    }
}
