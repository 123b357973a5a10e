//! Stands in for `tls` in a build without the feature `tls`: no certificate can be trusted, so no
//! connection is encrypted.

use super::ClientError;
use std::convert::Infallible;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::Instant;

/// The message for everybody who names a certificate.
const NOT_BUILT: &str =
    "built without encryption; build with `--features tls`, as in `cargo run --features tls watch`";

/// The certificates that a client trusts. This build lacks the feature `tls`, so there is no value
/// of this type.
#[derive(Clone, Debug)]
pub struct Trust(Infallible);

impl Trust {
    /// Refuses, because this build has no encryption.
    ///
    /// # Errors
    ///
    /// Always fails with [`ClientError::Tls`], which says how to build with encryption.
    pub fn from_file(_: &Path) -> Result<Self, ClientError> {
        Self::from_pem(&[])
    }

    /// Refuses, because this build has no encryption.
    ///
    /// # Errors
    ///
    /// Always fails with [`ClientError::Tls`], which says how to build with encryption.
    pub fn from_pem(_: &[u8]) -> Result<Self, ClientError> {
        Err(ClientError::Tls(NOT_BUILT.to_owned()))
    }

    /// Is never called, because there is no `Trust`.
    pub(super) fn shake_hands(
        &self,
        _: &str,
        _: TcpStream,
        _: Instant,
    ) -> Result<Option<TlsStream>, ClientError> {
        match self.0 {}
    }
}

/// An encrypted connection, of which this build has none.
#[derive(Debug)]
pub(super) struct TlsStream {
    pub(super) sock: TcpStream,
    never: Infallible,
}

impl Read for TlsStream {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        match self.never {}
    }
}

impl Write for TlsStream {
    fn write(&mut self, _: &[u8]) -> io::Result<usize> {
        match self.never {}
    }

    fn flush(&mut self) -> io::Result<()> {
        match self.never {}
    }
}
