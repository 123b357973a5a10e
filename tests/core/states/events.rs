//! Events other than commands and the faults of a tick, each in every mode.

use super::*;

/// An event other than a command or a condition of `provoke`. Loss and return of the line are
/// separate events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Event {
    /// The port is gone for longer than the timeout.
    LineLost,
    /// The port was gone for longer than the timeout and is back. Its first reading says that
    /// torque had ended in the meantime.
    LineBack,
    /// The port was gone for less than the timeout.
    LineBlinks,
    /// The motor controllers have lost power.
    Reboot,
    /// A tick began more than 20 ms late.
    Late,
    /// Ten ticks were skipped.
    Skipped,
    /// A motor's own sensor reports overheating.
    Hot,
    /// The holder has disconnected. By policy its torque stream ramps down to zero.
    ClientRamp,
    /// The holder has disconnected. By policy its torque stream ends when it expires.
    ClientKeep,
    /// The holder has disconnected. By policy this is a fault.
    ClientFault,
    /// The signal SIGUSR1, which the loop handles before all other commands of the tick.
    Signal,
}

const EVENTS: [Event; 11] = [
    Event::LineLost,
    Event::LineBack,
    Event::LineBlinks,
    Event::Reboot,
    Event::Late,
    Event::Skipped,
    Event::Hot,
    Event::ClientRamp,
    Event::ClientKeep,
    Event::ClientFault,
    Event::Signal,
];

fn happen(event: Event, bench: &mut Bench) -> Outputs {
    let watchdog = |bench: &mut Bench| bench.step_with(|inputs| complain(inputs, |c| c.watchdog = true));
    let policy = |bench: &mut Bench, policy| {
        bench.command(Command::ClientLost(policy));
        bench.step()
    };
    match event {
        Event::LineLost => provoke(Cause::LinkLost, bench),
        Event::LineBack => {
            provoke(Cause::LinkLost, bench);
            watchdog(bench)
        }
        Event::LineBlinks => {
            bench.deaf();
            watchdog(bench)
        }
        Event::Reboot => bench.step_with(|inputs| inputs.rebooted = true),
        Event::Late => provoke(Cause::Deadline, bench),
        Event::Skipped => {
            bench.tick += 10;
            bench.step()
        }
        Event::Hot => provoke(Cause::Thermal, bench),
        Event::ClientRamp => policy(bench, OnClientLost::Ramp),
        Event::ClientKeep => policy(bench, OnClientLost::Keep),
        Event::ClientFault => policy(bench, OnClientLost::Fault),
        Event::Signal => bench.step_with(|inputs| {
            for command in [Command::Estop, Command::Enable, Command::Reset] {
                inputs.commands.push(command).unwrap();
            }
        }),
    }
}

#[test]
fn every_event_leads_where_the_table_says_from_every_mode() {
    use Mode::{Active, Enabling, Estop, Fault, Idle, Unreferenced};
    for event in EVENTS {
        for from in MODES {
            let powered = matches!(from, Enabling | Active);
            let mut bench = bench_in(from);
            let before = bench.step().state;
            let outputs = happen(event, &mut bench);
            let (mode, cause) = (outputs.state.mode, outputs.state.cause);
            let place = format!("{event:?} from {from:?}: {mode:?} {cause:?}");
            let stays = (from, before.cause);
            let fault = |cause| (Fault, Some(if from == Fault { Cause::ControllerFault } else { cause }));
            let expected = match event {
                Event::LineLost | Event::LineBack => fault(Cause::LinkLost),
                // Without torque, no torque was lost.
                Event::LineBlinks => {
                    if powered {
                        fault(Cause::LinkLost)
                    } else {
                        stays
                    }
                }
                Event::Reboot => fault(Cause::ControllerFault),
                Event::Late | Event::Skipped => fault(Cause::Deadline),
                Event::Hot => fault(Cause::Thermal),
                Event::ClientRamp | Event::ClientKeep => stays,
                Event::ClientFault => fault(Cause::ClientLost),
                Event::Signal => (Estop, None),
            };
            assert_eq!((mode, cause), expected, "{place}");
            if matches!(mode, Fault | Estop) {
                assert!(outputs.state.torque == Vec3::ZERO && !outputs.drive.enable, "{place}");
                assert_eq!(outputs.drive.torque, [0.0; 16], "{place}");
            }
            // Only a command brings torque back, after any waiting time.
            if !powered || mode != from {
                let later = bench.run(700);
                assert_eq!((later.state.mode, later.state.cause), expected, "{place}");
                assert!(later.state.torque == Vec3::ZERO && !later.drive.enable, "{place}");
            }
            if !matches!(mode, Fault | Estop) {
                continue;
            }
            assert!(matches!(bench.command(Command::Enable).reply(), Reply::Refused(_)), "{place}");
            // The index is not seen again. Zeros stay valid after everything except a loss of
            // power.
            let back = if from == Unreferenced || event == Event::Reboot { Unreferenced } else { Idle };
            let reset = bench.command(Command::Reset);
            assert_eq!((reset.reply(), reset.state.mode), (Reply::Done, back), "{place}");
        }
    }
}
