//! Gives the shared library its name for the dynamic linker. A program that was linked with it
//! finds the installed file by this name.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libhbot.so.0.1");
    }
}
