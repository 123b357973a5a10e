//! Certificates for servers that encrypt.

use hbot_api::Trust;
use hbot_config::rig::TlsFiles;
use rcgen::{BasicConstraints, CertificateParams, IsCa, KeyPair};

/// A self-signed certificate and its key, for a server that encrypts. They are made as docs/api.md
/// describes.
pub(crate) struct Identity {
    pub(crate) certificate: String,
    key: String,
}

impl Identity {
    pub(crate) fn new() -> Self {
        let mut params = CertificateParams::new(["rig.local".to_owned()]).expect("a name");
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().expect("a key");
        let certificate = params.self_signed(&key).expect("a certificate").pem();
        Self { certificate, key: key.serialize_pem() }
    }

    pub(crate) fn trust(&self) -> Trust {
        Trust::from_pem(self.certificate.as_bytes()).expect("a certificate")
    }

    /// Writes the certificate and the key to files in a temporary folder. The files exist until the
    /// returned folder is dropped.
    pub(crate) fn files(&self) -> (tempfile::TempDir, TlsFiles) {
        let folder = tempfile::tempdir().expect("a folder");
        let files =
            TlsFiles { certificate: folder.path().join("rig.pem"), key: folder.path().join("rig.key") };
        std::fs::write(&files.certificate, &self.certificate).expect("written");
        std::fs::write(&files.key, &self.key).expect("written");
        (folder, files)
    }
}
