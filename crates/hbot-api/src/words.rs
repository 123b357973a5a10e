//! Explanations of modes and faults in plain words, with remedies. The panel uses them directly,
//! and the server sends them in the answer to the op `info`.

use crate::{Fault, Mode};

impl Mode {
    /// Returns an explanation of this mode, for the person who uses the rig.
    #[must_use]
    pub const fn sentence(self) -> &'static str {
        match self {
            Self::Unreferenced => "The zero of the steering is not known. No torque until it is.",
            Self::Idle => "Ready. The motors are without torque.",
            Self::Enabling => "The torque is rising to its full size.",
            Self::Active => "The scene is rendered: the sphere pushes.",
            Self::Fault => "The rig has stopped by itself. No torque until a reset.",
            Self::Estop => "Stopped by somebody.",
        }
    }
}

impl Fault {
    /// Returns two explanations of this fault, for the person who uses the rig: what happened, and
    /// what to do about it.
    #[must_use]
    pub const fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::LinkLost => (
                "The motor controllers do not answer.",
                "Check power and cable of the controllers, then Reset.",
            ),
            Self::LinkCorrupt => (
                "Too many damaged messages from the motor controllers.",
                "Look for a loose plug, or a motor cable beside the serial cable. Then Reset.",
            ),
            Self::ControllerFault => (
                "A motor controller reports that it has a fault.",
                "Read the controller's own display or log, clear the fault there, then Reset.",
            ),
            Self::Overspeed => (
                "The sphere turned faster than the rig allows.",
                "Let it come to rest. Less stiffness or more damping keeps it slower. Then Reset.",
            ),
            Self::Overtorque => (
                "A motor took more current than it may, or more energy went into the hand than the rig allows.",
                "Less stiffness or more damping gives out less. Check limits.energy and the controllers, then Reset.",
            ),
            Self::Slip => (
                "The sphere slips on its wheels.",
                "Clean sphere and wheels, check how hard they are pressed together, or lower the torque. Then Reset.",
            ),
            Self::NonFinite => {
                ("A computed torque is not a number.", "Load another scene, keep the flight log, then Reset.")
            }
            Self::ImplausibleFeedback => (
                "An encoder reading that cannot be true.",
                "Check the encoder's cable, and counts_per_turn in the rig file. Then Reset.",
            ),
            Self::Deadline => (
                "The computer could not keep the loop's time.",
                "End other programs on this computer, give the server real-time rights or a lower rate, then Reset.",
            ),
            Self::ClientLost => (
                "The program that commanded the rig is gone.",
                "Start it again or take command here, then Reset.",
            ),
            Self::Thermal => (
                "A motor or its controller is too hot.",
                "Let it cool down. A softer scene heats it less. Then Reset.",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_mode_is_explained_by_its_own_words() {
        for (mode, subject) in [
            (Mode::Unreferenced, "zero of the steering"),
            (Mode::Idle, "Ready"),
            (Mode::Enabling, "rising"),
            (Mode::Active, "the sphere pushes"),
            (Mode::Fault, "stopped by itself"),
            (Mode::Estop, "Stopped by somebody"),
        ] {
            assert!(mode.sentence().contains(subject), "{mode}");
        }
    }

    #[test]
    fn each_fault_is_explained_by_its_own_words() {
        let subjects = [
            (Fault::LinkLost, "do not answer"),
            (Fault::LinkCorrupt, "damaged messages"),
            (Fault::ControllerFault, "has a fault"),
            (Fault::Overspeed, "turned faster"),
            (Fault::Overtorque, "more current"),
            (Fault::Slip, "slips"),
            (Fault::NonFinite, "torque is not a number"),
            (Fault::ImplausibleFeedback, "encoder"),
            (Fault::Deadline, "time"),
            (Fault::ClientLost, "is gone"),
            (Fault::Thermal, "too hot"),
        ];
        for cause in Fault::ALL {
            let (_, subject) = subjects.into_iter().find(|(it, _)| *it == cause).expect("a subject");
            assert!(cause.words().0.contains(subject), "{cause}: {subject}");
        }
    }

    #[test]
    fn the_words_for_each_fault_differ_and_tell_a_way_out() {
        let words: BTreeSet<_> = Fault::ALL.iter().map(|f| f.words()).collect();
        assert_eq!(words.len(), Fault::ALL.len());
        assert!(words.iter().all(|(_, cure)| cure.contains("Reset")));
    }
}
