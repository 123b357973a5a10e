//! Tests that an encrypted service serves exactly the clients that trust its certificate and show
//! its token.

use hbot_api::{Encoding, ErrorCode, Trust};
use hbot_config::rig::TlsFiles;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, DnType, IsCa, KeyPair};

use super::*;
use crate::tls::Encryption;

pub(super) struct Made {
    pub(super) certificate: String,
    key: String,
}

impl Made {
    pub(super) fn by_itself() -> Self {
        let made = rcgen::generate_simple_self_signed(["127.0.0.1".to_owned()]).unwrap();
        Self { certificate: made.cert.pem(), key: made.signing_key.serialize_pem() }
    }

    fn encryption(&self) -> Option<Encryption> {
        let folder = tempfile::tempdir().unwrap();
        let files = TlsFiles { certificate: folder.path().join("cert"), key: folder.path().join("key") };
        std::fs::write(&files.certificate, &self.certificate).unwrap();
        std::fs::write(&files.key, &self.key).unwrap();
        Some(Encryption::from_files(&files).unwrap())
    }

    pub(super) fn bench(&self) -> TestService {
        TestService::start(TestOptions { encryption: self.encryption(), ..TestOptions::default() })
    }
}

fn authority(called: &str) -> (CertifiedIssuer<'static, KeyPair>, String) {
    let mut params = CertificateParams::new([]).unwrap();
    params.distinguished_name.push(DnType::CommonName, called);
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let authority = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
    let pem = authority.pem();
    (authority, pem)
}

/// Returns a certificate for the host `name`, signed by `authority`, with its private key.
fn signed(authority: &CertifiedIssuer<'static, KeyPair>, name: &str) -> Made {
    let key = KeyPair::generate().unwrap();
    let certificate = CertificateParams::new([name.to_owned()]).unwrap().signed_by(&key, authority).unwrap();
    Made { certificate: certificate.pem(), key: key.serialize_pem() }
}

fn trusting(pem: &str) -> ConnectOptions {
    ConnectOptions {
        trust: Some(Trust::from_pem(pem.as_bytes()).unwrap()),
        timeout: PATIENCE,
        ..ConnectOptions::new("one who trusts")
    }
}

fn connect(bench: &TestService, options: &ConnectOptions) -> Result<Client, ClientError> {
    Client::connect_with(&bench.address.to_string(), options)
}

/// Connects to the service, which must fail because of the encryption. Returns the reason as text.
fn refusal(bench: &TestService, options: &ConnectOptions) -> String {
    match connect(bench, options) {
        Err(ClientError::Tls(why)) => why,
        other => panic!("{other:?}"),
    }
}

#[test]
fn who_trusts_the_authority_or_the_certificate_itself_is_served_in_both_encodings() {
    let (authority, pem) = authority("ours");
    let by_authority = signed(&authority, "127.0.0.1");
    let alone = Made::by_itself();
    for (made, pem) in
        [(&by_authority, &pem), (&by_authority, &by_authority.certificate), (&alone, &alone.certificate)]
    {
        let bench = made.bench();
        for encoding in [Encoding::Json, Encoding::Msgpack] {
            let mut client = connect(&bench, &ConnectOptions { encoding, ..trusting(pem) }).unwrap();
            assert_eq!(client.encoding(), encoding);
            client.subscribe(1).unwrap();
            for _ in 0..50 {
                event(&mut client, "state", |event| matches!(event, Event::State(_)).then_some(()));
            }
            let data = json!("x".repeat(2000));
            assert_eq!(client.ping(data.clone()).unwrap().data, data);
            // This answer is longer than a TLS record.
            assert!(serde_json::to_string(&client.info().unwrap()).unwrap().len() > 16 * 1024);
            client.unsubscribe().unwrap();
            while client.next_event(Duration::ZERO).unwrap().is_some() {}
            assert_eq!(client.next_event(Duration::from_millis(1)).unwrap(), None, "a wait that ends");
            client.acquire(false).unwrap();
            // A long message in the other direction.
            let scene = json!({"name": "x", "y": "x".repeat(60_000)});
            assert!(client.load_scene(scene).unwrap_err().to_string().contains("y"));
            assert_eq!(client.estop().unwrap(), Mode::Estop);
            assert!(client.reset().is_ok());
        }
        assert_eq!(bench.finish().handshakes_failed, 0);
    }
}

#[test]
fn a_server_that_is_not_the_one_trusted_gets_no_hello() {
    let (authority, pem) = authority("ours");
    let (_, stranger) = self::authority("another");
    let (_, namesake) = self::authority("ours");
    let bench = signed(&authority, "127.0.0.1").bench();
    for other in [stranger, namesake] {
        let why = refusal(&bench, &trusting(&other));
        assert!(why.contains("not trusted") && why.contains("authority"), "{why}");
    }
    let why = refusal(&bench, &trusting(&Made::by_itself().certificate));
    assert!(why.contains("not trusted"), "{why}");
    // The trusted authority signed this certificate, but for another host.
    let elsewhere = signed(&authority, "rig.example").bench();
    let why = refusal(&elsewhere, &trusting(&pem));
    assert!(why.contains("not trusted") && why.contains("a name that it is for"), "{why}");
    eventually("their end", || elsewhere.status.borrow().clients == 0);
    assert_eq!(elsewhere.finish().requests, 0, "no token went to a stranger");
    assert_eq!(bench.finish().requests, 0);
}

#[test]
fn nothing_else_than_encryption_is_spoken_on_its_port() {
    let made = Made::by_itself();
    let bench = made.bench();
    let why = refusal(&bench, &ConnectOptions { timeout: PATIENCE, ..ConnectOptions::new("plain") });
    assert!(why.contains("the server encrypts"), "{why}");
    let mut raw = bench.raw();
    raw.send(r#"{"id": 1, "op": "hello", "version": 1, "name": "raw"}"#);
    raw.send(r#"{"id": 2, "op": "estop"}"#);
    let mut said = Vec::new();
    // A reset ends the connection as well.
    let _ = raw.reader.read_to_end(&mut said);
    assert!(!said.contains(&b'{') && said.len() < 10, "an alert at most: {said:?}");
    let mut client = connect(&bench, &trusting(&made.certificate)).unwrap();
    assert_eq!(client.stats().unwrap().handshakes_failed, 2);
    let summary = bench.finish();
    assert_eq!((summary.estops, summary.handshakes_failed), (0, 2));
    // The reverse case: an encrypting client at a server without encryption.
    let plain = self::bench();
    let why = refusal(&plain, &trusting(&made.certificate));
    assert!(why.contains("does not encrypt"), "{why}");
}

#[test]
fn handshakes_that_hang_or_are_garbage_are_counted_and_hold_nobody_up() {
    let made = Made::by_itself();
    // Time enough for the client that completes its handshake. The stalled connections keep their
    // places until this time is over.
    let bounds = Bounds { hello: Duration::from_secs(5), ..TestOptions::default().bounds };
    let bench =
        TestService::start(TestOptions { encryption: made.encryption(), bounds, ..TestOptions::default() });
    let silent: Vec<_> = (0..10).map(|_| TcpStream::connect(bench.address).unwrap()).collect();
    // The first bytes of a handshake, and nothing after them.
    let halting: Vec<_> = (0..10)
        .map(|_| {
            let mut stream = TcpStream::connect(bench.address).unwrap();
            stream.write_all(&[0x16, 3, 1, 2, 0, 1, 0, 1, 0xfc]).unwrap();
            stream
        })
        .collect();
    for k in 0..10_u32 {
        let mut stream = TcpStream::connect(bench.address).unwrap();
        let garbage: Vec<u8> =
            (0..20_000_u32).map(|i| (i.wrapping_add(k).wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        // The server can close the connection before all bytes are sent.
        let _ = stream.write_all(&garbage);
    }
    // The next client is served although many handshakes stall.
    let tried = std::cell::Cell::new(0);
    eventually("a client", || {
        tried.set(tried.get() + 1);
        connect(&bench, &trusting(&made.certificate)).is_ok()
    });
    let ticks = |bench: &TestService| bench.status.borrow().sample.map_or(0, |sample| sample.state.tick);
    let before = ticks(&bench);
    eventually("their end", || {
        let (wanted, summary) = oneshot::channel();
        bench.control.blocking_send(Control::Summarize(wanted)).unwrap();
        summary.blocking_recv().unwrap().handshakes_failed >= 30
    });
    assert!(ticks(&bench) > before);
    drop((silent, halting));
    let summary = bench.finish();
    // None of these connections made a request. On a slow machine, attempts of the good client can
    // be refused for a late hello.
    assert!(summary.refused.total() < tried.get(), "{:?}", summary);
    assert_eq!(summary.dropped_samples, 0);
}

#[test]
fn a_token_is_asked_for_behind_encryption_too() {
    let made = Made::by_itself();
    let token = Some("a secret of 24 characters".to_owned());
    let bench = TestService::start(TestOptions {
        encryption: made.encryption(),
        token: token.clone(),
        ..TestOptions::default()
    });
    let options = trusting(&made.certificate);
    match connect(&bench, &options) {
        Err(ClientError::Server(error)) => assert_eq!(error.code, ErrorCode::Unauthorized),
        other => panic!("{other:?}"),
    }
    connect(&bench, &ConnectOptions { token: token.map(Into::into), ..options }).unwrap();
}

#[test]
fn one_too_many_is_closed_without_a_plain_word() {
    let made = Made::by_itself();
    let bounds = Bounds { connections: 1, ..TestOptions::default().bounds };
    let bench =
        TestService::start(TestOptions { encryption: made.encryption(), bounds, ..TestOptions::default() });
    let first = connect(&bench, &trusting(&made.certificate)).unwrap();
    assert_eq!(bench.raw().rest(), "");
    drop(first);
    assert_eq!(bench.finish().connections_turned_away, 1);
}

#[test]
fn what_is_no_certificate_is_not_trusted() {
    let said = |text: &str| match Trust::from_pem(text.as_bytes()) {
        Err(ClientError::Tls(why)) => why,
        other => panic!("{other:?}"),
    };
    assert!(said("").contains("no certificate in it"));
    assert!(said(&Made::by_itself().key).contains("no certificate in it"));
    assert!(said(&Made::by_itself().certificate[..300]).contains("not PEM"));
    let error = Trust::from_file(std::path::Path::new("no-such-file")).unwrap_err().to_string();
    assert!(error.contains("no-such-file: cannot be read"), "{error}");
    let error = Trust::from_file(std::path::Path::new("/")).unwrap_err().to_string();
    assert_eq!(error, "/: this is a folder. Name a file with certificates (PEM)");
}
