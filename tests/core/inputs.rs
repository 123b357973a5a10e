//! The types of the inputs: complaints and lists of commands.

use hbot_core::inputs::{Command, Commands, Complaints, MAX_COMMANDS};

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

#[test]
fn a_list_of_commands_knows_how_many_it_holds() {
    let mut list = Commands::default();
    for n in 0..MAX_COMMANDS {
        assert_eq!((list.len(), list.is_empty(), list.iter().count()), (n, n == 0, n));
        assert_eq!(list.push(Command::Disable), Ok(()));
    }
    assert_eq!(list.push(Command::Estop), Err(Command::Estop), "it is full");
    assert_eq!((list.len(), list.is_empty()), (MAX_COMMANDS, false));
    assert!(list.iter().all(|command| *command == Command::Disable));
}
