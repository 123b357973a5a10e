//! Encryption of the TCP service with TLS 1.3, if the rig file asks for it.

use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;

use hbot_config::rig::TlsFiles;
use thiserror::Error;
use tokio::net::TcpStream;
use tokio::runtime::Runtime;
use tokio::task::JoinSet;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{Error as PemError, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{Error as TlsError, ServerConfig, ServerConnection, version};
use tokio_rustls::server::TlsStream;

use crate::background;

/// Limit of the unsent bytes that a TLS session buffers: one TLS record. The limit is small so that
/// the server notices progress of a client that reads slowly, and does not cut it as one that does
/// not read.
const RECORD: usize = 16 * 1024;

/// The reason why the files named in `[api] tls` of the rig file cannot be used.
#[derive(Debug, Error)]
pub enum CertificateError {
    /// The certificate file cannot be used.
    #[error("api.tls.certificate: {}: {what}; legal: a file with at least one section BEGIN CERTIFICATE (PEM)", path.display())]
    Certificate {
        /// Path of the certificate file.
        path: PathBuf,
        /// What is wrong with the file.
        what: String,
    },
    /// The private key file cannot be used.
    #[error("api.tls.key: {}: {what}; legal: a file with one section BEGIN PRIVATE KEY (PEM), without a password", path.display())]
    Key {
        /// Path of the key file.
        path: PathBuf,
        /// What is wrong with the file.
        what: String,
    },
    /// The thread for TLS handshakes could not be started.
    #[error("api.tls: the system gives no thread: {0}")]
    Thread(std::io::Error),
    /// The certificate and the key do not belong together.
    #[error(
        "api.tls: {} and {} do not go together: {what}; legal: the key that the file's first certificate was made for",
        files.certificate.display(),
        files.key.display()
    )]
    Pair {
        /// The certificate file and the key file.
        files: TlsFiles,
        /// What is wrong with the pair.
        what: String,
    },
}

/// Encrypts connections with TLS. Handshakes run on a separate thread, because any unknown client
/// can ask for one and each costs computing time for the private key. This must not delay the
/// thread that serves clients.
#[derive(Clone)]
pub struct Encryption {
    acceptor: TlsAcceptor,
    shaker: Arc<Shaker>,
}

/// The thread that performs TLS handshakes. The limit of connections without a hello also bounds
/// the number of simultaneous handshakes.
struct Shaker(Option<Runtime>);

impl Shaker {
    fn start() -> std::io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("hbot-tls")
            .on_thread_start(background::give_way)
            .enable_io()
            .build()?;
        Ok(Self(Some(runtime)))
    }

    /// Runs a future on the handshake thread. Dropping the returned future cancels the work.
    async fn work<T: Send + 'static>(
        &self,
        work: impl Future<Output = std::io::Result<T>> + Send + 'static,
    ) -> std::io::Result<T> {
        let Some(runtime) = &self.0 else { return Err(std::io::ErrorKind::NotConnected.into()) };
        let mut task = JoinSet::new();
        task.spawn_on(work, runtime.handle());
        match task.join_next().await {
            Some(Ok(done)) => done,
            Some(Err(error)) => Err(error.into()),
            None => Err(std::io::ErrorKind::NotConnected.into()),
        }
    }
}

impl Drop for Shaker {
    fn drop(&mut self) {
        if let Some(runtime) = self.0.take() {
            // The last owner can be an async task, which must not block until the thread ends.
            runtime.shutdown_background();
        }
    }
}

impl Encryption {
    /// Creates the encryption from a certificate file and a private key file.
    ///
    /// # Errors
    /// Fails if a file cannot be read or parsed, if the key does not match the certificate, or if
    /// the handshake thread cannot be started.
    pub fn from_files(files: &TlsFiles) -> Result<Self, CertificateError> {
        let certificate =
            |what: String| CertificateError::Certificate { path: files.certificate.clone(), what };
        let text =
            std::fs::read(&files.certificate).map_err(|e| certificate(format!("cannot be read: {e}")))?;
        let chain = CertificateDer::pem_slice_iter(&text)
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| certificate(format!("not PEM: {error}")))?;
        if chain.is_empty() {
            return Err(certificate("no certificate in it".to_owned()));
        }
        let key = |what: String| CertificateError::Key { path: files.key.clone(), what };
        let text = std::fs::read(&files.key).map_err(|e| key(format!("cannot be read: {e}")))?;
        let private = PrivateKeyDer::from_pem_slice(&text).map_err(|error| {
            key(match error {
                PemError::NoItemsFound => "no private key in it".to_owned(),
                other => format!("not PEM: {other}"),
            })
        })?;
        let pair = |error: TlsError| CertificateError::Pair {
            files: files.clone(),
            what: match error {
                // By default the TLS library does not say that the certificate belongs to another
                // key.
                TlsError::InconsistentKeys(_) => "the key is another certificate's".to_owned(),
                other => other.to_string(),
            },
        };
        let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_protocol_versions(&[&version::TLS13])
            .map_err(pair)?
            .with_no_client_auth()
            .with_single_cert(chain, private)
            .map_err(pair)?;
        let shaker = Arc::new(Shaker::start().map_err(CertificateError::Thread)?);
        Ok(Self { acceptor: TlsAcceptor::from(Arc::new(config)), shaker })
    }

    /// Performs the TLS handshake on the handshake thread. If the handshake fails, the connection
    /// is closed and the error is returned. Dropping the future cancels the handshake.
    pub(crate) async fn shake_hands(&self, stream: TcpStream) -> std::io::Result<TlsStream<TcpStream>> {
        let (stream, acceptor) = (stream.into_std()?, self.acceptor.clone());
        let shaken = self.shaker.work(async move {
            let bounded = |session: &mut ServerConnection| session.set_buffer_limit(Some(RECORD));
            // A tokio stream belongs to the runtime on which it was created, so it is created anew
            // on each runtime.
            let (stream, session) =
                acceptor.accept_with(TcpStream::from_std(stream)?, bounded).await?.into_inner();
            Ok((stream.into_std()?, session))
        });
        let (stream, session) = shaken.await?;
        let stream = TcpStream::from_std(stream)?;
        // Replace the new session by the finished one. No handshake is left to do.
        self.acceptor.accept_with(stream, |new| *new = session).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn hands_are_shaken_on_a_thread_that_gives_way() {
        let shaker = Shaker::start().unwrap();
        let work = shaker.work(async {
            let niceness = rustix::process::getpriority_process(Some(rustix::thread::gettid()))?;
            Ok((std::thread::current().name().map(str::to_owned), niceness))
        });
        let (name, niceness) = work.await.unwrap();
        assert_eq!(name.as_deref(), Some("hbot-tls"));
        assert!(niceness >= background::NICENESS, "{niceness}");
    }

    #[test]
    fn each_file_that_is_no_good_is_named_with_what_would_be() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let made = rcgen::generate_simple_self_signed(["rig".to_owned()]).unwrap();
        let other = rcgen::KeyPair::generate().unwrap();
        std::fs::write(at("good.pem"), made.cert.pem()).unwrap();
        std::fs::write(at("good.key"), made.signing_key.serialize_pem()).unwrap();
        std::fs::write(at("other.key"), other.serialize_pem()).unwrap();
        std::fs::write(at("empty"), "").unwrap();
        std::fs::write(at("cut.pem"), &made.cert.pem()[..200]).unwrap();
        let said = |certificate: &str, key: &str| {
            let files = TlsFiles { certificate: at(certificate), key: at(key) };
            Encryption::from_files(&files).map(drop).map_err(|error| error.to_string())
        };
        assert_eq!(said("good.pem", "good.key"), Ok(()));
        for (certificate, key, words) in [
            ("none", "good.key", ["api.tls.certificate", "none: cannot be read"]),
            ("empty", "good.key", ["api.tls.certificate", "empty: no certificate in it"]),
            ("cut.pem", "good.key", ["api.tls.certificate", "cut.pem: not PEM"]),
            ("good.key", "good.key", ["api.tls.certificate", "good.key: no certificate in it"]),
            ("good.pem", "none", ["api.tls.key", "none: cannot be read"]),
            ("good.pem", "good.pem", ["api.tls.key", "good.pem: no private key in it"]),
            ("good.pem", "other.key", ["api.tls: ", "the key is another certificate's"]),
        ] {
            let said = said(certificate, key).unwrap_err();
            assert!(words.iter().all(|word| said.contains(word)) && said.contains("legal: "), "{said}");
        }
    }
}
