//! The folder of a study's results: it is tried before the study begins, because a study takes
//! minutes.

use std::io::{Error, ErrorKind};
use std::path::Path;

use crate::WriteError;

/// Name of the file that is written into the folder and removed again.
const TRIED: &str = ".hbot-study.partial";

/// Checks that files can be written into the folder `out`, and leaves everything as it was. It
/// writes a file there and removes it. If the folder does not exist, it and its parents are created
/// and removed again.
///
/// # Errors
///
/// Fails with the path and the error of the operating system if `out` cannot be created or written.
pub(crate) fn check_writable(out: &Path) -> Result<(), WriteError> {
    // An empty path, such as the parent of `out`, stands for the working directory.
    let missing: Vec<&Path> =
        out.ancestors().take_while(|path| !path.as_os_str().is_empty() && !path.exists()).collect();
    let tried = create_and_write(out);
    for path in missing {
        // Those that were not created, or that another program uses meanwhile, stay as they are.
        let _ = std::fs::remove_dir(path);
    }
    tried
}

fn create_and_write(out: &Path) -> Result<(), WriteError> {
    let failed = |source| WriteError { path: out.to_owned(), source };
    std::fs::create_dir_all(out).map_err(|error| match error.kind() {
        // "File exists" alone does not say what is wrong.
        ErrorKind::AlreadyExists => failed(Error::new(error.kind(), "is a file, not a folder")),
        _ => failed(error),
    })?;
    let file = out.join(TRIED);
    std::fs::write(&file, "").and_then(|()| std::fs::remove_file(&file)).map_err(failed)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn nothing_is_left_of_the_trial() {
        let folder = tempfile::tempdir().expect("a folder");
        let there = || std::fs::read_dir(folder.path()).expect("a folder").count();
        for out in [folder.path().to_owned(), folder.path().join("deep/down")] {
            check_writable(&out).expect("it can be written");
            assert_eq!(there(), 0, "{}", out.display());
        }
        let kept = folder.path().join("kept");
        std::fs::create_dir(&kept).expect("a folder");
        check_writable(&kept.join("new")).expect("it can be written");
        assert!(kept.exists() && !kept.join("new").exists());
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_named() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        // No user can create a file in /proc/self.
        for out in [file.path().to_owned(), file.path().join("below"), PathBuf::from("/proc/self")] {
            let error = check_writable(&out).expect_err("it is no folder");
            assert_eq!(error.path, out, "{error}");
        }
        assert!(check_writable(file.path()).expect_err("a file").to_string().contains("not a folder"));
    }
}
