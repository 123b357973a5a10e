//! Parts that give way between motors and sphere: where they end the stiffness of a spring, without
//! and with the lead.

use hbot_core::Vec3;
use hbot_plot::short;
use hbot_sim::phenomena::{Compliance, Phenomena};
use serde_json::json;

use super::search::bisected;
use crate::context::Context;
use crate::report::{Report, row};
use crate::whole::{Whole, motor, prototype, refine, spring};

/// Stiffnesses of each contact, N/m. The first is that of rigid parts.
const CONTACTS: [f64; 6] = [1.0e9, 1.0e6, 3.0e5, 1.0e5, 3.0e4, 1.0e4];
/// Damping of the rendered spring, N m s/rad.
const DAMPING: f64 = 0.01;
/// Time constant of the motors' torque, s.
const LAG_S: f64 = 5.0e-4;
/// How many times as fine the encoders are as the prototype's.
const FINER: u32 = 256;
/// Time for which the sphere is observed after a tap, s.
const WATCH_S: f64 = 1.5;
/// Angular velocity of the tap, rad/s. The torques stay far below their limits.
const TAP: Vec3 = Vec3::new(2.0e-3, 1.0e-3, -1.5e-3);
/// Width of the range to which a search narrows a border, relative to the border.
const RESOLUTION: f64 = 0.01;
/// Stiffest spring of a scene, N m/rad. No search goes beyond it.
const STIFFEST: f64 = 1000.0;

/// Returns parts of which each contact has the stiffness `contact` (N/m). The cage is ten times as
/// stiff. The ratio of damping to critical damping is that of the default parts.
fn parts(contact: f64) -> Compliance {
    let usual = Compliance::default();
    let times = contact / usual.contact_stiffness;
    Compliance {
        contact_stiffness: contact,
        contact_damping: (usual.contact_damping * times.sqrt()).min(1.0e5),
        cage_stiffness: (usual.cage_stiffness * times).min(1.0e9),
        cage_damping: usual.cage_damping * times.sqrt(),
    }
}

/// Returns whether the whole loop swings up on a spring of `stiffness` (N m/rad) after a small tap.
fn grows(contact: f64, lead: bool, stiffness: f64) -> bool {
    let mut config = prototype(&[
        ("loop.lead", json!(lead)),
        ("loop.passivity", json!(false)),
        ("loop.shaking_guard", json!(false)),
        ("limits.slip", json!(10.0)),
    ]);
    refine(&mut config, FINER);
    let phenomena =
        Phenomena { motor: Some(motor(LAG_S)), compliance: Some(parts(contact)), ..Phenomena::default() };
    let mut whole = Whole::new(&config, spring(stiffness, DAMPING), phenomena);
    let energies = whole.swung(TAP, stiffness, WATCH_S);
    // Also true for an energy that is not a number, and after a fault.
    !(energies[4] < energies[2]) || !whole.is_active()
}

/// Returns the stiffness from which the whole loop swings up, N m/rad, at most [`STIFFEST`].
fn border(contact: f64, lead: bool) -> f64 {
    // From soft to stiff in steps of a factor, because a loop can be stable again above a border.
    let mut low = 1.0;
    loop {
        let high = (low * 1.5_f64).min(STIFFEST);
        if grows(contact, lead, high) {
            return bisected([low, high], RESOLUTION, |stiffness| grows(contact, lead, stiffness));
        }
        if high >= STIFFEST {
            return STIFFEST;
        }
        low = high;
    }
}

/// Returns the torsional stiffness that contacts of stiffness `contact` (N/m) give the sphere about
/// n1 against held wheels, N m/rad: k R² sum (1 - (c3.n1)²).
fn torsional(contact: f64) -> f64 {
    let device = prototype(&[]).rig.device;
    let across = device.wheels().iter().map(|wheel| {
        let normal = hbot_core::design::kinematics::ContactFrame::at(wheel, 0.0).c3;
        1.0 - normal.x * normal.x
    });
    contact * device.sphere_radius() * device.sphere_radius() * across.sum::<f64>()
}

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("parts that give way");
    introduce(report);
    let head = ["contact, N/m", "about n1, N m/rad", "without lead, N m/rad", "with lead", "ratio"];
    let mut table = vec![row(head)];
    let contacts = if context.quick { &CONTACTS[3..4] } else { &CONTACTS[..] };
    for contact in contacts {
        let [without, with] = [border(*contact, false), border(*contact, true)];
        for (lead, value) in [("off", without), ("on", with)] {
            report.figure(format!("compliance_{contact:.0}_lead_{lead}"), value);
        }
        let name = if *contact >= 1.0e9 { "rigid (1e9)".to_owned() } else { short(*contact) };
        table.push(row([
            name,
            short(torsional(*contact)),
            short(without),
            short(with),
            short(with / without),
        ]));
        if *contact >= 1.0e9 {
            let rigid = DAMPING / (1.5e-3 + LAG_S);
            report.check_within(
                "rigid contacts without lead swing up from B/(h (1/2 + D) + lag)",
                (without / rigid - 1.0).abs(),
                0.03,
            );
        }
    }
    report.table(&table);
}

fn introduce(report: &mut Report) {
    report.heading("Parts that give way");
    report.say(&format!(
        "The whole loop at 1 kHz, motors with a lag of {} ms, a spring with a damping of {DAMPING} N m s/rad: the stiffness from which a small tap swings up, if contacts and cage give way \
         (docs/simulator.md). The cage is ten times as stiff as a contact; the damping ratio is that of the default parts. The second column is the stiffness of all contacts together about n1, \
         against held wheels. Encoders are {FINER} times as fine as the prototype's. Each border is found to {} %; the search ends at {STIFFEST} N m/rad.",
        short(1.0e3 * LAG_S),
        short(100.0 * RESOLUTION),
    ));
    report.family("compliance_{contact}_lead_{lead} | N m/rad | stiffness of a spring from which the whole loop swings up, if each contact has this stiffness, N/m, without and with the lead");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A soft spring rests and a stiff one swings up, without and with the lead.
    #[test]
    fn a_border_lies_between_a_soft_and_a_stiff_spring() {
        for lead in [false, true] {
            assert!(!grows(1.0e5, lead, 1.0));
            // Far above the border the swing reaches the torque limit before it is compared.
            assert!(grows(1.0e4, lead, 12.0));
        }
        assert!(grows(1.0e6, false, 20.0) && !grows(1.0e6, true, 20.0));
    }
}
