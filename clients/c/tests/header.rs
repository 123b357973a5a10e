//! The committed header is what cbindgen writes from the sources.

use std::path::Path;

/// Compares `include/hbot.h` with the output of cbindgen. With `HBOT_BLESS` set it writes the file.
#[test]
fn the_header_is_up_to_date() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).expect("a configuration");
    // cbindgen follows the modules of this file.
    let builder = cbindgen::Builder::new().with_config(config).with_src(root.join("src/lib.rs"));
    let mut written = Vec::new();
    builder.generate().expect("a header").write(&mut written);
    let path = root.join("include/hbot.h");
    if std::env::var_os("HBOT_BLESS").is_some() {
        std::fs::write(&path, &written).expect("the header can be written");
    }
    let committed = std::fs::read(&path).expect("include/hbot.h");
    assert!(
        committed == written,
        "include/hbot.h is out of date: HBOT_BLESS=1 cargo test -p hbot-c --test header writes it"
    );
}

#[test]
fn every_function_is_declared_once() {
    let header = include_str!("../include/hbot.h");
    let code = header.lines().filter(|line| !line.trim_start().starts_with(['*', '/']));
    let declared = code.filter_map(|line| line.split_once('(')?.0.rsplit([' ', '*']).next());
    let mut declared: Vec<&str> = declared.filter(|name| name.starts_with("hbot_")).collect();
    let all = declared.len();
    declared.sort_unstable();
    declared.dedup();
    assert_eq!(declared.len(), all);
    assert!(all > 30, "{all} functions");
}

#[test]
fn a_state_has_room_for_every_rig() {
    assert_eq!(hbot_c::HBOT_MAX_JOINTS, hbot_core::MAX_JOINTS);
}
