//! `hbot scene check --watch`: checks a scene file on each save, and loads it into a server.

use std::path::Path;
use std::time::{Duration, SystemTime};

use anyhow::bail;
use hbot_host::run_loop::signals;

use super::super::out::{self, note, say};
use super::super::{Commanding, style};
use super::{Which, check, load};

/// How often the file is looked at. A save is noticed after at most twice this time.
const EVERY: Duration = Duration::from_millis(150);

/// Checks the scene now and after each save of its file, until a signal comes. A legal scene is
/// loaded into the server `to`. Mistakes, and a server that refuses, are told and end nothing.
pub(super) fn run(which: &Which, to: &Commanding) -> anyhow::Result<()> {
    if !which.scene.is_file() {
        // Says what is wrong with the name, unless it is that of a ready-made scene.
        super::scene(&which.scene)?;
        bail!("{}: a ready-made scene does not change; name a file", which.scene.display());
    }
    let stop = signals::stop_flag()?;
    let mut seen = None;
    say!("{}watching{} {}; Ctrl-C ends", style::NAME, style::OFF, which.scene.display())?;
    while !stop.is_set() {
        let now = saved(&which.scene);
        if now != seen {
            seen = settled(&which.scene, now);
            match super::scene(&which.scene) {
                Ok(scene) => {
                    // The server that takes it checks it too, for its own rig.
                    let told = load(&scene, false, to).or_else(|error| {
                        out::error(&error);
                        check(which).map(drop)
                    });
                    told.unwrap_or_else(|error| out::error(&error));
                }
                Err(error) => {
                    out::error(&error);
                    note!("a server that has taken an earlier version renders that");
                }
            }
        }
        std::thread::sleep(EVERY);
    }
    Ok(())
}

/// Returns when the file was saved last, and its size. `None` while there is none: some editors
/// replace the file.
fn saved(path: &Path) -> Option<(SystemTime, u64)> {
    let about = std::fs::metadata(path).ok()?;
    Some((about.modified().ok()?, about.len()))
}

/// Waits until the file does not change any more, so that half a file is not read.
fn settled(path: &Path, mut now: Option<(SystemTime, u64)>) -> Option<(SystemTime, u64)> {
    loop {
        std::thread::sleep(EVERY / 3);
        let later = saved(path);
        if later == now {
            return later;
        }
        now = later;
    }
}
