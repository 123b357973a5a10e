//! The lease: which client may command the rig.

use hbot_api::{ErrorBody, ErrorCode, LeaseCause, LeaseEvent, LeaseInfo, OpName, Requester};

/// The lease, which is the right to command the rig, and the client that holds it, if any.
#[derive(Default)]
pub(super) struct Lease {
    holder: Option<Holder>,
}

struct Holder {
    session: u64,
    name: String,
}

impl Lease {
    pub(super) fn is_held_by(&self, session: u64) -> bool {
        self.holder.as_ref().is_some_and(|holder| holder.session == session)
    }

    /// Returns the name of the client that holds the lease, if any.
    pub(super) fn name(&self) -> Option<&str> {
        self.holder.as_ref().map(|holder| holder.name.as_str())
    }

    pub(super) fn info(&self) -> LeaseInfo {
        let holder = self.holder.as_ref();
        LeaseInfo {
            holder: holder.map(|holder| holder.name.clone()),
            session: holder.map(|holder| holder.session),
        }
    }

    /// Returns the event that all clients receive after a change of the lease. `by` is the client
    /// that took the lease, gave it back, or lost it with its connection.
    pub(super) fn event(&self, cause: LeaseCause, by: Option<Requester>) -> LeaseEvent {
        let LeaseInfo { holder, session } = self.info();
        LeaseEvent { holder, session, cause, by }
    }

    /// Checks that `session` holds the lease, which the op `what` requires.
    ///
    /// # Errors
    /// Fails if `session` does not hold the lease.
    pub(super) fn require(&self, session: u64, what: &str) -> Result<(), ErrorBody> {
        if self.is_held_by(session) {
            return Ok(());
        }
        let held = self.name().map(|name| format!(", which {name:?} holds")).unwrap_or_default();
        let message = format!("op {what} needs the lease{held}: {} first", OpName::Acquire);
        let holder = self.name().map(str::to_owned);
        Err(ErrorBody { holder, ..ErrorBody::new(ErrorCode::NotHolder, message) })
    }

    /// Gives the lease to `session`. Returns whether it was acquired or stolen, or `None` if
    /// `session` holds it already.
    ///
    /// # Errors
    /// Fails if another client holds the lease and `steal` is false.
    pub(super) fn acquire(
        &mut self,
        session: u64,
        name: &str,
        steal: bool,
    ) -> Result<Option<LeaseCause>, ErrorBody> {
        let cause = match &self.holder {
            Some(holder) if holder.session == session => return Ok(None),
            None => LeaseCause::Acquired,
            Some(_) if steal => LeaseCause::Stolen,
            Some(Holder { name, .. }) => {
                let message = format!("{name:?} holds the lease; steal takes it");
                let holder = Some(name.clone());
                return Err(ErrorBody { holder, ..ErrorBody::new(ErrorCode::Busy, message) });
            }
        };
        self.holder = Some(Holder { session, name: name.to_owned() });
        Ok(Some(cause))
    }

    /// Frees the lease if `session` holds it. Returns true if the lease was freed.
    pub(super) fn free(&mut self, session: u64) -> bool {
        let held = self.is_held_by(session);
        if held {
            self.holder = None;
        }
        held
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_client_holds_it_and_only_a_thief_takes_it_away() {
        let mut lease = Lease::default();
        assert_eq!(
            lease.require(1, "enable").unwrap_err().message,
            "op enable needs the lease: acquire first"
        );
        assert_eq!(lease.acquire(1, "ann", false), Ok(Some(LeaseCause::Acquired)));
        assert_eq!(lease.acquire(1, "ann", true), Ok(None), "it has it already");
        assert_eq!((lease.require(1, "enable"), lease.free(2)), (Ok(()), false));
        let refused = lease.require(2, "enable").unwrap_err();
        assert_eq!((refused.code, refused.holder.as_deref()), (ErrorCode::NotHolder, Some("ann")));
        assert_eq!(refused.message, "op enable needs the lease, which \"ann\" holds: acquire first");
        let busy = lease.acquire(2, "bob", false).unwrap_err();
        assert_eq!((busy.code, busy.holder.as_deref()), (ErrorCode::Busy, Some("ann")));
        assert_eq!(lease.acquire(2, "bob", true), Ok(Some(LeaseCause::Stolen)));
        let event = lease.event(LeaseCause::Stolen, None);
        assert_eq!((event.holder.as_deref(), event.session), (Some("bob"), Some(2)));
        assert!(!lease.free(1) && lease.free(2) && lease.name().is_none());
    }
}
