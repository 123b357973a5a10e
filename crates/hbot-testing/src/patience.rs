//! Waits for a condition in a test, for a limited time.

use std::time::{Duration, Instant};

/// Longest time for which a test waits for a condition. It is long because a busy computer can be
/// slow. It is no requirement on the speed of the program.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Time between two checks of a condition that a test waits for.
pub const LOOK: Duration = Duration::from_millis(1);

/// Calls `found` every millisecond until it returns a value, and returns that value. `what`
/// describes the awaited condition for the panic message.
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

/// Waits until `condition` returns true. It is checked every millisecond. `what` describes the
/// condition for the panic message.
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
