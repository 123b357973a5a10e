//! Explanations of modes, faults and complaints of motor controllers in plain words, with remedies.

use hbot_api::{ControllerFlag, Fault, Mode};

/// Returns an explanation of a mode of the rig, for the person who uses it.
pub(crate) const fn mode(mode: Mode) -> &'static str {
    match mode {
        Mode::Unreferenced => "The zero of the steering is not known. No torque until it is.",
        Mode::Idle => "Ready. The motors are without torque.",
        Mode::Enabling => "The torque is rising to its full size.",
        Mode::Active => "The scene is rendered: the sphere pushes.",
        Mode::Fault => "The rig has stopped by itself. No torque until a reset.",
        // The window adds which button goes on.
        Mode::Estop => "Stopped by somebody.",
    }
}

/// Returns two explanations of a fault, for the person who uses the rig: what happened, and what to
/// do about it.
pub(crate) const fn fault(fault: Fault) -> (&'static str, &'static str) {
    match fault {
        Fault::LinkLost => {
            ("The motor controllers do not answer.", "Check power and cable of the controllers, then Reset.")
        }
        Fault::LinkCorrupt => (
            "Too many damaged messages from the motor controllers.",
            "Look for a loose plug, or a motor cable beside the serial cable. Then Reset.",
        ),
        Fault::ControllerFault => (
            "A motor controller reports that it has a fault.",
            "Read the controller's own display or log, clear the fault there, then Reset.",
        ),
        Fault::Overspeed => (
            "The sphere turned faster than the rig allows.",
            "Let it come to rest. Less stiffness or more damping keeps it slower. Then Reset.",
        ),
        Fault::Overtorque => (
            "A motor took more current than it may, or more energy went into the hand than the rig allows.",
            "Less stiffness or more damping gives out less. Check limits.energy and the controllers, then Reset.",
        ),
        Fault::Slip => (
            "The sphere slips on its wheels.",
            "Clean sphere and wheels, check how hard they are pressed together, or lower the torque. Then Reset.",
        ),
        Fault::NonFinite => {
            ("A computed torque is not a number.", "Load another scene, keep the flight log, then Reset.")
        }
        Fault::ImplausibleFeedback => (
            "An encoder reading that cannot be true.",
            "Check the encoder's cable, and counts_per_turn in the rig file. Then Reset.",
        ),
        Fault::Deadline => (
            "The computer could not keep the loop's time.",
            "End other programs on this computer, give the server real-time rights or a lower rate, then Reset.",
        ),
        Fault::ClientLost => (
            "The program that commanded the rig is gone.",
            "Start it again or take command here, then Reset.",
        ),
        Fault::Thermal => (
            "A motor or its controller is too hot.",
            "Let it cool down. A softer scene heats it less. Then Reset.",
        ),
    }
}

/// Returns an explanation of what a motor controller complains of, for the person who uses the rig.
pub(crate) const fn controller(flag: ControllerFlag) -> &'static str {
    match flag {
        ControllerFlag::Fault => "The controller reports that it has a fault.",
        ControllerFlag::Watchdog => "Its watchdog has expired: no command arrived in time.",
        ControllerFlag::Overcurrent => "The motor's current is at its limit or beyond it.",
        ControllerFlag::Overtemperature => "The motor or the power stage is too hot.",
        ControllerFlag::Disobeyed => {
            "The motor is on although it was commanded off, or off although it was commanded on."
        }
        ControllerFlag::NotFinite => "It has reported a value that is not a number.",
        ControllerFlag::Restarted => "It may have lost power, and with it the zero of its joint.",
        ControllerFlag::Silent => "Nothing has arrived from it for 0.2 s.",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_complaint_of_a_controller_is_explained_by_its_own_words() {
        let subjects = [
            (ControllerFlag::Fault, "has a fault"),
            (ControllerFlag::Watchdog, "watchdog"),
            (ControllerFlag::Overcurrent, "current"),
            (ControllerFlag::Overtemperature, "too hot"),
            (ControllerFlag::Disobeyed, "commanded off"),
            (ControllerFlag::NotFinite, "not a number"),
            (ControllerFlag::Restarted, "lost power"),
            (ControllerFlag::Silent, "Nothing has arrived"),
        ];
        assert_eq!(subjects.map(|(flag, _)| flag), ControllerFlag::ALL);
        for (flag, subject) in subjects {
            let explained = ControllerFlag::ALL.map(|it| (it, controller(it).contains(subject)));
            let only = ControllerFlag::ALL.map(|it| (it, it == flag));
            assert_eq!(explained, only, "{subject}");
        }
    }

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
            assert!(super::mode(mode).contains(subject), "{mode}");
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
            assert!(fault(cause).0.contains(subject), "{cause}: {subject}");
        }
    }

    #[test]
    fn the_words_for_each_fault_differ_and_tell_a_way_out() {
        let words: BTreeSet<_> = Fault::ALL.iter().map(|f| fault(*f)).collect();
        assert_eq!(words.len(), Fault::ALL.len());
        assert!(words.iter().all(|(_, cure)| cure.contains("Reset")));
    }
}
