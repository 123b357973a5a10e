//! An encrypted server, with the command line as its client.

use std::path::Path;
use std::process::Output;

use crate::process::*;

fn rig(folder: &Path) -> String {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a certificate");
    std::fs::write(folder.join("rig.pem"), made.cert.pem()).expect("written");
    std::fs::write(folder.join("rig.key"), made.signing_key.serialize_pem()).expect("written");
    let prototype = include_str!("../../rigs/prototype.toml");
    let encrypted =
        prototype.replace("[api]", "[api]\ntls = { certificate = \"rig.pem\", key = \"rig.key\" }");
    assert_ne!(encrypted, prototype, "the prototype has no [api]");
    let path = folder.join("rig.toml");
    std::fs::write(&path, encrypted).expect("written");
    path.to_str().expect("UTF-8").to_owned()
}

fn ask(args: &[&str]) -> (Output, String) {
    let out = hbot().args(args).output().expect("it runs");
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    (out, said)
}

#[test]
fn the_command_line_speaks_to_a_server_that_encrypts() {
    let folder = tempfile::tempdir().expect("a folder");
    let (rig, at) =
        (rig(folder.path()), |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned());
    let server = Process::start(&["--rig", &rig, "--time", "virtual"], folder.path());
    assert!(server.banner.contains("TLS"), "{}", server.banner);
    let ca = at("rig.pem");
    let (out, said) = ask(&["estop", "--server", &server.address, "--ca", &ca]);
    assert!(out.status.success() && out.stdout.starts_with(b"estop"), "{said}");
    let (out, said) = ask(&["reset", "--server", &server.address, "--ca", &ca]);
    assert!(out.status.success(), "{said}");

    let (out, said) = ask(&["estop", "--server", &server.address]);
    assert_eq!(out.status.code(), Some(1));
    assert!(said.contains("the server encrypts") && said.contains("--ca FILE"), "{said}");
    assert!(said.contains("NOT STOPPED"), "{said}");
    let other = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a certificate");
    std::fs::write(at("other.pem"), other.cert.pem()).expect("written");
    let (out, said) = ask(&["estop", "--server", &server.address, "--ca", &at("other.pem")]);
    assert_eq!(out.status.code(), Some(1));
    assert!(said.contains("not trusted"), "{said}");
    let (out, said) = ask(&["estop", "--server", &server.address, "--ca", &at("rig.key")]);
    assert_eq!(out.status.code(), Some(1));
    assert!(said.contains("--ca") && said.contains("no certificate in it"), "{said}");
}

#[test]
fn another_machine_needs_a_token_behind_encryption_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let (out, said) =
        ask(&["server", "--rig", &rig(folder.path()), "--listen", "0.0.0.0:0", "--time", "virtual"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(said.contains("--token-file"), "{said}");
}

#[test]
fn a_certificate_that_cannot_be_used_ends_the_server_before_it_begins() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = rig(folder.path());
    let start =
        || ask(&["server", "--rig", &rig, "--listen", "127.0.0.1:0", "--time", "virtual", "--duration", "1"]);
    assert!(start().0.status.success());
    std::fs::write(folder.path().join("rig.pem"), "no certificate").expect("written");
    let (out, said) = start();
    assert_eq!(out.status.code(), Some(1));
    assert!(said.contains("rig.pem: no certificate in it; legal: "), "{said}");
    std::fs::remove_file(folder.path().join("rig.key")).expect("removed");
    std::fs::write(
        folder.path().join("rig.pem"),
        rcgen::generate_simple_self_signed([]).expect("one").cert.pem(),
    )
    .expect("written");
    let (out, said) = start();
    assert_eq!(out.status.code(), Some(1));
    assert!(said.contains("api.tls.key") && said.contains("rig.key: cannot be read"), "{said}");
}
