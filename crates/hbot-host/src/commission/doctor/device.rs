//! Checks of a serial device that do not open it.

use std::fs;
use std::os::unix::fs::FileTypeExt as _;
use std::path::Path;

use rustix::fs::{Access, access};

use super::{Finding, Mark};
use crate::line::serial::LatencyTimer;

/// Checks that a serial device exists, is accessible, is not in use, and does not delay received
/// data by a long latency timer. The device is not opened, because opening can restart the
/// controllers.
#[must_use]
pub fn serial(port: &str) -> Vec<Finding> {
    let path = Path::new(port);
    if !path.exists() {
        let found = format!("{port} is not there");
        let mend =
            "plug the controllers in and switch them on; `ls /dev/serial/by-id` shows what the system sees";
        return vec![Finding::new("serial_device", Mark::NotSufficient, found, mend)];
    }
    if !fs::metadata(path).is_ok_and(|it| it.file_type().is_char_device()) {
        let found = format!("{port} is no device");
        let mend = "name the controllers' port: `ls /dev/serial/by-id` shows what the system sees";
        return vec![Finding::new("serial_device", Mark::NotSufficient, found, mend)];
    }
    let allowed = access(path, Access::READ_OK | Access::WRITE_OK).is_ok();
    let (mark, found) = if allowed {
        (Mark::Good, format!("{port} may be read and written"))
    } else {
        (Mark::NotSufficient, format!("{port} may not be read and written by this user"))
    };
    let mend = "`sudo usermod -aG dialout $USER` and log in anew, or contrib/99-hbot.rules";
    let mut findings = vec![Finding::new("serial_device", mark, found, mend)];
    let holders = holders(path);
    if !holders.is_empty() {
        let found = format!("{port} is in use by {}", holders.join(", "));
        let mend =
            "end that program, unless it is the server that is to have the port: a port is for one program";
        findings.push(Finding::new("serial_user", Mark::Usable, found, mend));
    }
    findings.push(match LatencyTimer::of(path) {
        None => Finding::new(
            "latency_timer",
            Mark::Good,
            format!("the driver of {port} has no latency timer"),
            "",
        ),
        Some(timer) => Finding::new(
            "latency_timer",
            if timer.ms <= 1 { Mark::Good } else { Mark::NotSufficient },
            format!("{port} holds readings back for up to {} ms", timer.ms),
            &format!("`echo 1 | sudo tee {}`, or contrib/99-hbot.rules for good", timer.path.display()),
        ),
    });
    findings
}

/// Returns the names and numbers of the processes that have the device open, as far as this user
/// can see them.
fn holders(device: &Path) -> Vec<String> {
    let Ok(device) = fs::canonicalize(device) else { return Vec::new() };
    let has_it_open = |process: &Path| {
        let open = fs::read_dir(process.join("fd")).into_iter().flatten().flatten();
        open.filter_map(|file| fs::read_link(file.path()).ok()).any(|file| file == device)
    };
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    processes
        .filter_map(|entry| {
            let id: u32 = entry.file_name().to_str()?.parse().ok()?;
            let name = fs::read_to_string(entry.path().join("comm")).ok()?;
            has_it_open(&entry.path()).then(|| format!("{} (process {id})", name.trim()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_that_is_not_there_is_told() {
        let findings = serial("/dev/no-such-port");
        assert_eq!((findings.len(), findings[0].mark), (1, Mark::NotSufficient));
    }

    #[test]
    fn a_file_is_no_port() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        let findings = serial(&file.path().display().to_string());
        assert!(findings.len() == 1 && findings[0].found.contains("is no device"), "{findings:?}");
    }

    #[test]
    fn who_has_a_port_open_is_named() {
        let mine = format!("(process {})", std::process::id());
        let told = || serial("/dev/null").into_iter().find(|finding| finding.id == "serial_user");
        let open = fs::File::open("/dev/null").expect("it opens");
        assert!(told().is_some_and(|finding| finding.found.contains(&mine)));
        drop(open);
    }
}
