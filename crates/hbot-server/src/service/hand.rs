//! The simulated hand, which clients can move.

use hbot_api::{ErrorBody, ErrorCode, HandCommand, HandHold};
use hbot_core::Vec3;
use hbot_sim::hand::{Guide, HandTorque};
use hbot_sim::phenomena::Hand;

use super::convert;

/// An order to the simulated hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HandOrder {
    /// Turn the sphere to an orientation.
    Turn(Guide),
    /// Let go of the sphere.
    Release,
    /// Move as the scene says.
    Resume,
}

/// Passes an order to the simulated hand. It must not wait.
pub type MoveHand = Box<dyn FnMut(HandOrder) + Send>;

/// The hand of a simulated rig.
pub struct SimulatedHand {
    /// Passes an order to the hand.
    pub order: MoveHand,
    /// The torque of the hand on the sphere.
    pub torque: HandTorque,
}

/// The service's side of the simulated hand. It does nothing with a real rig.
#[derive(Default)]
pub(super) struct SceneHand {
    hand: Option<SimulatedHand>,
    /// True if the client that holds the lease has given the hand an order.
    guided: bool,
}

impl SceneHand {
    pub(super) fn new(hand: Option<SimulatedHand>) -> Self {
        Self { hand, guided: false }
    }

    /// Moves the hand as a client wants.
    ///
    /// # Errors
    /// Fails with a real rig.
    pub(super) fn obey(&mut self, command: &HandCommand) -> Result<(), ErrorBody> {
        let Some(SimulatedHand { order, .. }) = &mut self.hand else {
            let message = "op hand: this rig is real; only the simulated rig has a hand that a program moves";
            return Err(ErrorBody::new(ErrorCode::OutOfRange, message));
        };
        self.guided = true;
        order(match command {
            HandCommand::Hold(hold) => HandOrder::Turn(guide(hold)),
            HandCommand::Release { .. } => HandOrder::Release,
        });
        Ok(())
    }

    /// Lets the hand move as the scene says again, if a client has given it an order. Called when
    /// this client loses the lease.
    pub(super) fn resume(&mut self) {
        if let Some(SimulatedHand { order, .. }) = &mut self.hand
            && std::mem::take(&mut self.guided)
        {
            order(HandOrder::Resume);
        }
    }

    /// Records that a scene has named the phenomena of the simulated rig. Its hand has replaced a
    /// guided one.
    pub(super) fn replaced(&mut self) {
        self.guided = false;
    }

    /// Returns the torque of the hand on the sphere, N m. `None` if no hand holds it.
    pub(super) fn torque(&self) -> Option<[f64; 3]> {
        self.hand.as_ref()?.torque.get().map(Vec3::into)
    }
}

fn guide(hold: &HandHold) -> Guide {
    let usual = Hand::default();
    Guide {
        q: convert::quaternion(hold.q),
        over_s: hold.over_ms as f64 * 1.0e-3,
        stiffness: hold.stiffness.unwrap_or(usual.stiffness),
        damping: hold.damping.unwrap_or(usual.damping),
        inertia: hold.inertia.unwrap_or(usual.inertia),
    }
}
