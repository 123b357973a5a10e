//! Conclusions for a builder, and the limits of the model.

use super::fronts::Fronts;
use super::margins::{HOLDS, grip};
use super::space::{DEGREE, Parts};
use super::torus::Measures;
use crate::report::Report;

/// A function that returns one figure of a measured design, such as its peak torque.
type Of = fn(&Measures) -> f64;

pub(super) fn tell(report: &mut Report, parts: &Parts, fronts: &Fronts) {
    let p = &fronts.prototype;
    let over = |wheels: usize, of: Of| fronts.of(wheels).iter().map(move |found| of(&found.measures));
    let most = |wheels: usize, of: Of| over(wheels, of).fold(f64::NEG_INFINITY, f64::max);
    let least = |wheels: usize, of: Of| over(wheels, of).fold(f64::INFINITY, f64::min);
    let [gci, torque, inertia, steering]: [Of; 4] = [|m| m.gci, |m| m.torque, |m| m.inertia, |m| m.speed[0]];

    report.heading("What a builder should conclude");
    let place = place(fronts);
    report.say(&format!("- **The prototype.** {place}"));
    report.say(&format!(
        "- **The cone** trades steering speed against traction and conditioning. A larger one steers slower (the sphere's rate over sin a), but brings the contacts nearer to each other at the worst steering angles, so conditioning falls and contacts slip \
         earlier. With two wheels the margin of {HOLDS} N m before slip ends it: the contacts must stay {:.0} deg apart, so that the wheels of no two-wheeled design are steered slower than {:.2} times the sphere's rate, where the prototype's are at {:.2}; with three they come down to {:.2}, with four to {:.2}. It hardly changes the inertia, \
         because the module's arm grows as the leverage falls; below about 8 deg the rotor's share soars.",
        libm::asin(HOLDS / (grip(parts) * parts.sphere_radius())) / DEGREE,
        least(2, steering),
        p.speed[0],
        least(3, steering),
        least(4, steering),
    ));
    report.say(
        "- **The wheel's radius** trades peak torque against conditioning: in the worst direction the drives bear the load, with R/r for a gear. r = R sin a conditions best; smaller wheels turn the sphere harder, and press their contacts harder too.",
    );
    report.say(
        "- **The toe** is best left at zero, or a few degrees: it makes the two rows of a wheel oblique, so conditioning, speed, inertia and traction lose, and the torque in the worst direction gains nothing. Where a best design has some, it is what a search leaves undecided.",
    );
    report.say(
        "- **The tilt** wants 45 deg for two wheels and about 55 for three or four, as far as the cage leaves room: at wide cones the open half pushes axes down.",
    );
    report.say(&format!(
        "- **More wheels.** The best conditioning is {:.2} with two, {:.2} with three, {:.2} with four; the highest peak torque {:.2}, {:.2}, {:.2} N m; the least inertia {:.2e}, {:.2e}, {:.2e} kg m². The step from two to three is the large one: it lifts the limit of traction, and any slip of a wheel shows. \
         A fourth adds torque, and inertia. A device to be felt as light keeps two; one for strength, or for orientation without a camera, takes three.",
        most(2, gci),
        most(3, gci),
        most(4, gci),
        most(2, torque),
        most(3, torque),
        most(4, torque),
        least(2, inertia),
        least(3, inertia),
        least(4, inertia),
    ));
    report.say(&format!(
        "- **Peak torque needs grip.** The motors' peak is worth having only as far as the contacts hold: the table of the best designs has the contact force at peak torque, which is mu N at least; the prototype's mu N of {} N is assumed. Beyond it the controller scales torque down. More normal force means more friction in the cage.",
        grip(parts)
    ));
    where_it_ends(report);
}

/// Returns the report's sentences that compare the prototype with the best designs found for two,
/// three and four wheels.
fn place(fronts: &Fronts) -> String {
    let p = &fronts.prototype;
    let beaten: usize = [2, 3, 4].map(|wheels| fronts.dominating(wheels)).iter().sum();
    if beaten == 0 {
        let near = fronts.nearest_above(3).map_or(String::new(), |(found, _)| {
            let m = &found.measures;
            format!(
                " Three wheels come nearest to it from above: {:.1} times the torque and {:.0} % less steering speed for {:.0} % less conditioning and {:.0} % more inertia.",
                m.torque / p.torque,
                100.0 * (1.0 - m.speed[0] / p.speed[0]),
                100.0 * (1.0 - m.gci / p.gci),
                100.0 * (m.inertia / p.inertia - 1.0)
            )
        });
        format!(
            "Nothing that was found beats the prototype in all four figures: it lies on the front of two-wheeled designs, to the 0.1 deg and 0.1 mm that were searched. What puts it there is its toe of zero and its axes at \
             45 deg; along the front cone and radius are a matter of taste, each gain in one figure paid in another. Every added wheel adds inertia, so more wheels do not beat it either.{near}"
        )
    } else {
        let by = [2, 3, 4].map(|wheels| fronts.nearest_above(wheels).map_or(0.0, |(_, by)| by));
        let by = by.into_iter().fold(0.0, f64::max);
        format!(
            "{beaten} designs that were found beat the prototype in all four figures, the best of them by {:.1} % in each: by that much it lies off the front.",
            100.0 * (by - 1.0)
        )
    }
}

fn where_it_ends(report: &mut Report) {
    report.heading("Where the model ends");
    report.say(
        "Contacts are points: no patch, so no pivoting friction (which grows with cot a and favours wide cones), no creep, no wear. Wheels, forks and cage are rigid; a smaller wheel or a longer arm bends more. The normal force is the same at every wheel and posture, and the cage carries it without friction. \
         Motors have the same peak at any speed: a design that steers fast may meet its back-EMF ceiling first. A module's room is a cone with an allowance, no drawing. Inertias beyond the paper's figures are assumed, as said above. Wheels are alike and evenly spread: other arrangements were not looked at. \
         What is told at the worst posture may be rare: 5 % figures stand beside it in summary.json.",
    );
}
