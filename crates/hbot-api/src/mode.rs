//! The modes of the rig and the causes of faults, each with its words for the person who uses the
//! rig. Panel and commands take the words from here, and the page from the answer to the op `info`.

use crate::names::names;

names! {
    /// The mode of the rig, which says what the control law is doing.
    pub enum Mode {
        /// The zeros of the steer joints are not known yet. There is no torque.
        Unreferenced = "unreferenced": "The zero of the steering is not known. No torque until it is.",
        /// The rig is ready to be enabled. There is no torque.
        Idle = "idle": "Ready. The motors are without torque.",
        /// The rig was enabled, and the torque rises over 0.5 s.
        Enabling = "enabling": "The torque is rising to its full size.",
        /// The rig renders the scene.
        Active = "active": "Torque is on: the sphere can push at any time.",
        /// A fault has stopped the rig. There is no torque until a reset.
        Fault = "fault": "The rig has stopped by itself. No torque until a reset.",
        /// An emergency stop has stopped the rig. There is no torque until a reset.
        Estop = "estop": "Stopped by somebody.",
    }

    /// Returns an explanation of this mode, for the person who uses the rig.
    fn sentence() -> &'static str;
}

names! {
    /// The cause of a fault, which makes the rig stop by itself.
    pub enum Fault {
        /// No new reading came from a motor controller for `timeout_ticks` ticks (a key of the rig
        /// file).
        LinkLost = "link_lost": (
            "The motor controllers do not answer.",
            "Check power and cable of the controllers, and whether other programs keep this computer busy.",
        ),
        /// Too many damaged frames were received on the serial line.
        LinkCorrupt = "link_corrupt": (
            "Too many damaged messages from the motor controllers.",
            "Look for a loose plug, or a motor cable beside the serial cable.",
        ),
        /// A motor controller has reported a fault.
        ControllerFault = "controller_fault": (
            "A motor controller reports that it has a fault.",
            "Read the controller's own display or log, and clear the fault there.",
        ),
        /// The sphere turns faster than the limit in the rig file.
        Overspeed = "overspeed": (
            "The sphere turned faster than the rig allows.",
            "Let it come to rest. Less stiffness or more damping keeps it slower.",
        ),
        /// A motor controller has reported too much current, or the energy delivered to the hand
        /// exceeds the rig's limit.
        Overtorque = "overtorque": (
            "A motor took more current than it may, or more energy went into the hand than the rig allows.",
            "Less stiffness or more damping gives out less. Check limits.energy and the controllers.",
        ),
        /// The slip between a wheel and the sphere exceeds the rig's limit.
        Slip = "slip": (
            "The sphere slips on its wheels.",
            "Clean sphere and wheels, check how hard they are pressed together, or lower the torque.",
        ),
        /// A computed value is not a finite number.
        NonFinite = "non_finite": (
            "A computed torque is not a number.",
            "Load another scene, and keep the flight log.",
        ),
        /// A reading from a motor controller contains values that are physically impossible.
        ImplausibleFeedback = "implausible_feedback": (
            "An encoder reading that cannot be true.",
            "Check the encoder's cable, and counts_per_turn in the rig file.",
        ),
        /// The control loop could not keep its tick rate.
        Deadline = "deadline": (
            "The computer could not keep the loop's time.",
            "End other programs on this computer, or give the server real-time rights or a lower rate.",
        ),
        /// The connection of the client that holds the lease ended, and the rig file makes this a
        /// fault.
        ClientLost = "client_lost": (
            "The program that commanded the rig is gone.",
            "Start it again or take command here.",
        ),
        /// A motor or its motor controller is too hot.
        Thermal = "thermal": (
            "A motor or its controller is too hot.",
            "Let it cool down. A softer scene heats it less.",
        ),
    }

    /// Returns two explanations of this fault, for the person who uses the rig: what happened, and
    /// what to do about it before a reset.
    fn words() -> (&'static str, &'static str);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_words_for_each_fault_differ() {
        let words: BTreeSet<_> = Fault::ALL.iter().map(|f| f.words()).collect();
        assert_eq!(words.len(), Fault::ALL.len());
        assert!(words.iter().all(|(_, cure)| !cure.contains("Reset")), "each program says how to go on");
    }
}
