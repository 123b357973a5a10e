//! How long a test waits, and how it waits.

use std::time::{Duration, Instant};

/// The longest that a test waits for a condition. It never says how fast anything is: a busy
/// machine may take most of it.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// The time between two looks at a condition.
pub const LOOK: Duration = Duration::from_millis(1);

/// Looks at `found` every millisecond until it gives something, and returns that. `what` names the
/// condition.
///
/// # Panics
/// After [`PATIENCE`], with `what`.
pub fn until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + PATIENCE;
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(Instant::now() < deadline, "not within {PATIENCE:?}: {what}");
        std::thread::sleep(LOOK);
    }
}

/// Looks at `condition` every millisecond until it holds. `what` names it.
///
/// # Panics
/// After [`PATIENCE`], with `what`.
pub fn eventually(what: &str, mut condition: impl FnMut() -> bool) {
    until(what, || condition().then_some(()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_is_looked_at_until_it_holds() {
        let mut looks = 0;
        eventually("the fifth look", || {
            looks += 1;
            looks == 5
        });
        assert_eq!(looks, 5);
        assert_eq!(until("a number", || Some(3)), 3);
    }
}
