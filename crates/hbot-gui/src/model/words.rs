//! Explanations of the complaints of motor controllers in plain words.

use hbot_api::ControllerFlag;

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
}
