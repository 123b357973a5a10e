//! Complaints of motor controllers.

use crate::prelude::*;

/// Each complaint alone, in the order of the fields.
fn each() -> [Complaints; 6] {
    let none = Complaints::default();
    [
        Complaints { fault: true, ..none },
        Complaints { watchdog: true, ..none },
        Complaints { overcurrent: true, ..none },
        Complaints { overtemperature: true, ..none },
        Complaints { disobeyed: true, ..none },
        Complaints { not_finite: true, ..none },
    ]
}

#[test]
fn complaints_of_either_are_those_of_both() {
    let (none, all) = (Complaints::default(), each().into_iter().fold(Complaints::default(), Complaints::or));
    let six = Complaints {
        fault: true,
        watchdog: true,
        overcurrent: true,
        overtemperature: true,
        disobeyed: true,
        not_finite: true,
    };
    assert_eq!((all, none.or(none)), (six, none));
    for one in each() {
        assert_ne!(one, none);
        assert_eq!((one.or(none), none.or(one), one.or(one)), (one, one, one));
        assert_eq!((one.or(all), all.or(one)), (all, all));
    }
}
