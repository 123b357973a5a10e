//! The names of clients that people start.

use crate::{MAX_NAME_BYTES, is_plain};

/// Returns the name of a client: the name of the program, the user and the machine, such as `panel
/// anna@lab2`. So people at other clients see who commands and who has stopped the rig.
///
/// The result is a legal name: characters that are not [plain](is_plain) are left out, and a name
/// of more than [`MAX_NAME_BYTES`] bytes is cut.
#[must_use]
pub fn client_name(program: &str) -> String {
    let or_unknown = |name: whoami::Result<String>| name.unwrap_or_else(|_| "unknown".to_owned());
    named(program, &or_unknown(whoami::username()), &or_unknown(whoami::hostname()))
}

fn named(program: &str, user: &str, host: &str) -> String {
    // The name of the machine without its domain, which says little and is often long.
    let host = host.split('.').next().unwrap_or_default();
    let mut name: String = format!("{program} {user}@{host}").chars().filter(|c| is_plain(*c)).collect();
    name.truncate(name.floor_char_boundary(MAX_NAME_BYTES));
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_legal_whatever_the_machine_is_called() {
        assert_eq!(named("panel", "anna", "lab2.example.org"), "panel anna@lab2");
        assert_eq!(named("panel", "an\u{202e}na", "lab\n2"), "panel anna@lab2");
        let long = named("panel", &"\u{e4}".repeat(100), "lab2");
        assert!(long.len() <= MAX_NAME_BYTES && long.len() > MAX_NAME_BYTES - 2, "{long}");
        let name = client_name("panel");
        assert!(name.starts_with("panel ") && name.contains('@') && name.len() <= MAX_NAME_BYTES, "{name}");
    }
}
