//! Records the compiler version, profile and optimisation level in environment variables at compile
//! time. Every report names them in its description of the machine.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let version = Command::new(rustc).arg("--version").output().ok();
    let version = version.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    println!("cargo::rustc-env=HBOT_STUDY_RUSTC={}", version.unwrap_or_else(|| "unknown".to_owned()));
    for (name, key) in [("PROFILE", "HBOT_STUDY_PROFILE"), ("OPT_LEVEL", "HBOT_STUDY_OPT_LEVEL")] {
        println!("cargo::rustc-env={key}={}", std::env::var(name).unwrap_or_default());
    }
}
