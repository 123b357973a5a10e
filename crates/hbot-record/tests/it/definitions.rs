//! The messages in `src/messages` are those of `proto`.

use std::path::Path;

#[test]
fn messages_are_made_from_their_definitions() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let set = protox::compile([root.join("proto/hbot.proto")], [root.join("proto")]).unwrap();
    let out = tempfile::tempdir().unwrap();
    prost_build::Config::new().out_dir(out.path()).compile_fds(set.clone()).unwrap();
    let bare = {
        // Comments and positions in the source are of no use to a reader of a recording.
        let mut set = set;
        set.file.iter_mut().for_each(|file| file.source_code_info = None);
        prost::Message::encode_to_vec(&set)
    };
    std::fs::write(out.path().join("descriptors.bin"), bare).unwrap();
    for name in ["hbot.rs", "foxglove.rs", "descriptors.bin"] {
        let (made, kept) = (out.path().join(name), root.join("src/messages").join(name));
        if std::env::var_os("HBOT_BLESS").is_some() {
            std::fs::copy(&made, &kept).unwrap();
        }
        let made = std::fs::read(made).unwrap();
        assert!(std::fs::read(kept).ok() == Some(made), "{name}: HBOT_BLESS=1 writes it");
    }
}
