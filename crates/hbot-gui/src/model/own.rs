//! The connections of this panel, by which it recognizes what it has done itself.

/// Largest number of connections that are kept.
const MAX_KEPT: usize = 32;

/// The numbers that the server has given to this panel's connections of one kind, oldest first.
///
/// The numbers of connections that have ended are kept, because the server can carry out a request
/// after its connection has ended: a stop that a silent server had not read yet is reported as that
/// of the old connection.
#[derive(Debug, Default)]
pub(crate) struct OwnSessions {
    numbers: Vec<u64>,
}

impl OwnSessions {
    /// Adds the number of a new connection. A server gives each connection a higher number than the
    /// one before. A number that is not higher is that of a server that has started again, so the
    /// earlier numbers are forgotten: there, they can belong to other clients.
    pub(crate) fn add(&mut self, number: u64) {
        if self.numbers.last().is_some_and(|last| number <= *last) {
            self.numbers.clear();
        }
        if self.numbers.len() == MAX_KEPT {
            self.numbers.remove(0);
        }
        self.numbers.push(number);
    }

    pub(crate) fn contains(&self, number: u64) -> bool {
        self.numbers.contains(&number)
    }

    pub(crate) fn clear(&mut self) {
        self.numbers.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_that_are_kept_are_bounded() {
        let mut own = OwnSessions::default();
        for number in 0..1000 {
            own.add(number);
        }
        assert_eq!(own.numbers.len(), MAX_KEPT);
        assert!(own.contains(999) && own.contains(1000 - MAX_KEPT as u64) && !own.contains(0));
    }
}
