//! Encryption: the TLS handshake, and which servers a client trusts.

use super::{ClientError, is_timeout};
use rustls::client::WebPkiServerVerifier;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, ring, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{
    CertificateError, ClientConfig, ClientConnection, DigitallySignedStruct, Error, RootCertStore,
    SignatureScheme, StreamOwned, version,
};
use std::io::ErrorKind;
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// A TLS connection to a server.
pub(super) type TlsStream = StreamOwned<ClientConnection, TcpStream>;

/// The certificates that a client trusts when it connects with TLS 1.3.
///
/// A certificate is trusted in one of two ways. If it is the server's own certificate, it is
/// **pinned**: neither its name nor its dates are checked. This suits a rig with a self-signed
/// certificate. Any other certificate is an **authority**: it must have signed the server's
/// certificate, which must be valid today and for the name or address of the connection.
#[derive(Clone, Debug)]
pub struct Trust(Arc<ClientConfig>);

impl Trust {
    /// Reads the trusted certificates from a PEM file.
    ///
    /// # Errors
    ///
    /// Fails with [`ClientError::Tls`] if the file cannot be read or contains no certificate.
    pub fn from_file(path: &Path) -> Result<Self, ClientError> {
        let wrong = |what: String| ClientError::Tls(format!("{}: {what}", path.display()));
        let text = std::fs::read(path).map_err(|error| match error.kind() {
            ErrorKind::IsADirectory => {
                wrong("this is a folder. Name a file with certificates (PEM)".to_owned())
            }
            _ => wrong(format!("cannot be read: {error}")),
        })?;
        Self::from_pem(&text).map_err(|error| match error {
            ClientError::Tls(what) => wrong(what),
            other => other,
        })
    }

    /// Reads the trusted certificates from a PEM text.
    ///
    /// # Errors
    ///
    /// Fails with [`ClientError::Tls`] if the text contains no certificate, or one that cannot be
    /// read.
    pub fn from_pem(text: &[u8]) -> Result<Self, ClientError> {
        let wrong = |what: String| ClientError::Tls(what);
        let certificates = CertificateDer::pem_slice_iter(text)
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| wrong(format!("not PEM: {error}")))?;
        if certificates.is_empty() {
            return Err(wrong(
                "no certificate in it (a section BEGIN CERTIFICATE, as PEM has it)".to_owned(),
            ));
        }
        let provider = Arc::new(ring::default_provider());
        let mut roots = RootCertStore::empty();
        for certificate in &certificates {
            roots
                .add(certificate.clone())
                .map_err(|error| wrong(format!("a certificate cannot be read: {error}")))?;
        }
        let authorities = WebPkiServerVerifier::builder_with_provider(Arc::new(roots), Arc::clone(&provider))
            .build()
            .map_err(|error| wrong(error.to_string()))?;
        let verifier = Verifier { pinned: certificates, authorities, provider: Arc::clone(&provider) };
        let config = ClientConfig::builder_with_provider(provider)
            .with_protocol_versions(&[&version::TLS13])
            .map_err(|error| wrong(error.to_string()))?
            .dangerous()
            .with_custom_certificate_verifier(Arc::new(verifier))
            .with_no_client_auth();
        Ok(Self(Arc::new(config)))
    }

    /// Performs the TLS handshake on `stream` with the server named `host`. Returns `None` if the
    /// handshake is not complete before `deadline`.
    pub(super) fn shake_hands(
        &self,
        host: &str,
        mut stream: TcpStream,
        deadline: Instant,
    ) -> Result<Option<TlsStream>, ClientError> {
        let name = ServerName::try_from(host.to_owned())
            .map_err(|_| ClientError::Tls(format!("{host:?} is no name that a certificate can be for")))?;
        let mut connection = ClientConnection::new(Arc::clone(&self.0), name).map_err(refusal)?;
        loop {
            while connection.wants_write() {
                connection.write_tls(&mut stream).map_err(ClientError::from_io)?;
            }
            if !connection.is_handshaking() {
                return Ok(Some(StreamOwned::new(connection, stream)));
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            stream.set_read_timeout(Some(left)).map_err(ClientError::from_io)?;
            match connection.read_tls(&mut stream) {
                Ok(0) => return Err(ClientError::Closed),
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) if is_timeout(&error) => return Ok(None),
                Err(error) => return Err(ClientError::from_io(error)),
            }
            if let Err(error) = connection.process_new_packets() {
                // Tells the server the reason. The connection has failed in any case, so errors
                // here do not matter.
                let _ = connection.write_tls(&mut stream);
                return Err(refusal(error));
            }
        }
    }
}

/// Converts the error of a failed TLS handshake to one whose message says what to do.
fn refusal(error: Error) -> ClientError {
    ClientError::Tls(match &error {
        Error::InvalidMessage(_) => "the server does not encrypt: leave out the certificate".to_owned(),
        Error::InvalidCertificate(reason) => {
            format!("the server's certificate is not trusted: {}", mistrust(reason))
        }
        _ => format!("no encrypted connection: {error}"),
    })
}

/// Explains why the server's certificate is not trusted, and what to do. Pinned certificates never
/// need this, because neither their name nor their dates are checked.
fn mistrust(reason: &CertificateError) -> String {
    use CertificateError as Reason;
    match reason {
        Reason::NotValidForName | Reason::NotValidForNameContext { .. } => {
            format!("{reason}; connect to a name that it is for, or name the server's own certificate")
        }
        Reason::Expired
        | Reason::ExpiredContext { .. }
        | Reason::NotValidYet
        | Reason::NotValidYetContext { .. } => format!(
            "{reason}; renew it, set this machine's clock, or name the server's own certificate, whose dates are not looked at"
        ),
        other => {
            let reason = match other {
                Reason::Other(other) => other.to_string(),
                other => other.to_string(),
            };
            // The latter is a self-signed certificate.
            let why = if *other == Reason::UnknownIssuer || reason == "CaUsedAsEndEntity" {
                "it is not in the file named, and no authority in that file has signed it".to_owned()
            } else {
                format!("the check by an authority failed ({reason})")
            };
            format!("{why}; copy the server's certificate from the rig PC, and name that file")
        }
    }
}

/// Checks the certificate of a server: it must be pinned, or signed by a trusted authority.
#[derive(Debug)]
struct Verifier {
    pinned: Vec<CertificateDer<'static>>,
    authorities: Arc<WebPkiServerVerifier>,
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for Verifier {
    fn verify_server_cert(
        &self,
        certificate: &CertificateDer<'_>,
        between: &[CertificateDer<'_>],
        name: &ServerName<'_>,
        status: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        if self.pinned.iter().any(|known| known == certificate) {
            return Ok(ServerCertVerified::assertion());
        }
        self.authorities.verify_server_cert(certificate, between, name, status, now)
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls12_signature(message, certificate, signed, &self.provider.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls13_signature(message, certificate, signed, &self.provider.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider.signature_verification_algorithms.supported_schemes()
    }
}
