//! Reads text files that a user has named. Reading is bounded in size and does not block for ever.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::Path;

/// Largest size of a rig file, scene file or recorded path, in bytes (1 MiB).
pub const MAX_TEXT: u64 = 1 << 20;

/// Reads a text file of at most [`MAX_TEXT`] bytes. The path must name a regular file, or an open
/// descriptor of any kind, such as `/dev/stdin` or `/dev/fd/63`.
///
/// # Errors
/// Fails if the operating system reports an error, if the file is too long or not UTF-8, or if the
/// path is a folder, device, FIFO or socket.
pub fn read_text(path: &Path) -> io::Result<String> {
    let wrong = |what: &str| io::Error::new(io::ErrorKind::InvalidInput, what);
    // Opening a FIFO can block for ever, and a device can have no end.
    if !is_open_already(path) && !fs::metadata(path)?.is_file() {
        return Err(wrong("it is no regular file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_TEXT + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_TEXT {
        return Err(wrong("it has more than 1 MiB"));
    }
    String::from_utf8(bytes).map_err(|_| wrong("it is not text (UTF-8)"))
}

/// Returns whether the path names a file descriptor that this process already has open.
fn is_open_already(path: &Path) -> bool {
    path == Path::new("/dev/stdin") || path.starts_with("/dev/fd") || path.starts_with("/proc/self/fd")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(path: &Path) -> String {
        read_text(path).unwrap_err().to_string()
    }

    #[test]
    fn only_a_regular_file_of_moderate_length_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for special in ["/dev/zero", "/dev/full", "/dev/null", "/"] {
            assert_eq!(refused(Path::new(special)), "it is no regular file", "{special}");
        }
        let file = File::create(at("long")).unwrap();
        file.set_len(MAX_TEXT + 1).unwrap();
        assert_eq!(refused(&at("long")), "it has more than 1 MiB");
        file.set_len(MAX_TEXT).unwrap();
        assert_eq!(read_text(&at("long")).unwrap().len() as u64, MAX_TEXT);
        fs::write(at("binary"), [0x7f, 0xff]).unwrap();
        assert_eq!(refused(&at("binary")), "it is not text (UTF-8)");
        fs::write(at("text"), "name = \"R²\"\n").unwrap();
        assert_eq!(read_text(&at("text")).unwrap(), "name = \"R²\"\n");
        assert!(refused(&at("nothing")).contains("No such file"));
    }

    #[test]
    fn what_is_open_already_is_read_by_its_descriptor() {
        use std::io::Write as _;
        use std::os::fd::AsRawFd as _;
        let (reader, mut writer) = io::pipe().unwrap();
        writer.write_all(b"gear = 1").unwrap();
        drop(writer);
        let path = format!("/dev/fd/{}", reader.as_raw_fd());
        assert_eq!(read_text(Path::new(&path)).unwrap(), "gear = 1");
    }
}
