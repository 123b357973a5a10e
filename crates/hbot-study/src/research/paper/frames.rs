//! Kinematics (section II, equations 1 to 13): the contact frames, G compared with the paper's
//! velocity equations, and equation 1 taken literally.

use hbot_config::RigConfig;
use hbot_core::design::kinematics::Posture;
use hbot_core::design::singularity::{interior_margin, interior_margin_over_all};
use hbot_core::rotation::{self, from_parts, vector_part};
use hbot_core::{Device, Mat3, Quat, Vec3, WheelSpec};
use hbot_plot::{Pen, Sketch, short};

use super::literal::{about, frame, least_rotation, rates};
use super::torus;
use crate::context::Context;
use crate::report::{Report, head, row};
use crate::rng::Rng;

pub(super) fn study(context: &Context, report: &mut Report) {
    context.part("kinematics of any number of wheels");
    report.heading("Kinematics (section II)");
    general(context, report);
    propagation(report);
    literal(report);
    let device = RigConfig::prototype().rig.device;
    report.plot(
        "frames",
        "The prototype's frames at steering angles of 130 and 35 deg, from the side and below: inertial axes n1, n2, n3, steering axes l1 and l2, the circles that the contact points \
         move on, the wheels, and their contact frames (c1 the axle, c2 the rolling direction, c3 the normal). What lies behind is paler",
        Sketch::panels(&[sketch(&device)]),
    );
}

/// Returns a random device with `wheels` wheels, cone angles of 0.1 to 1.5 rad and toe angles up to
/// 0.6 rad.
fn random_device(rng: &mut Rng, wheels: usize) -> Device {
    loop {
        let specs: Vec<WheelSpec> = (0..wheels)
            .map(|_| WheelSpec {
                axis: Vec3::from_array(rng.direction()),
                cone: rng.between(0.1, 1.5),
                toe: rng.between(-0.6, 0.6),
                radius: rng.between(0.01, 0.05),
                ..WheelSpec::default()
            })
            .collect();
        // Wheels that can meet are not a legal device, so another one is drawn.
        if let Ok(device) = Device::new(rng.between(0.05, 0.2), 0.5, &specs) {
            return device;
        }
    }
}

/// Compares the core's matrix G and contact frames with an independent derivation from rotation
/// matrices and rigid-body velocities. Uses random devices.
fn general(context: &Context, report: &mut Report) {
    report.say(
        "The kinematics are those of any number of wheels. On devices at random (2 to 8 wheels, axes anywhere, cone 0.1 to 1.5 rad, toe up to 0.6 rad) and random postures and \
         rates of the sphere, the core's closed forms against a separate derivation: contact frames as products of four rotation matrices (eq. 1, with A0 first), the velocities of the \
         contact point on the wheel and on the sphere as rigid bodies (eq. 4, 5), set equal along c1 and c2 (eq. 6, 7) and solved; that the steered frame turns about l, by \
         differences; and back: the rate of the sphere from those joint rates (eq. 11), with the slip that is left.",
    );
    report.family("kinematics_{quantity}_worst_error | 1 | worst difference over random devices; {quantity}: frames (of the unit vectors), joint_rates (relative to the largest), frame_rate (by differences), sphere_rate (relative), \
         slip (left over, relative to R w)");
    let mut rng = Rng(21);
    let mut worst = [0.0_f64; 5];
    for wheels in 2..=8 {
        for _ in 0..if context.quick { 20 } else { 200 } {
            let device = random_device(&mut rng, wheels);
            let th: Vec<f64> = (0..wheels).map(|_| rng.between(-3.1, 3.1)).collect();
            let omega = Vec3::from_array(rng.direction()) * rng.between(0.1, 10.0);
            let found = one(&device, &th, omega);
            for (worst, found) in worst.iter_mut().zip(found) {
                *worst = worst.max(found);
            }
        }
    }
    let names = ["frames", "joint_rates", "frame_rate", "sphere_rate", "slip"];
    // Bounds: the rounding of four matrix products and of a 2x2 solve that divides by sin(cone)
    // cos(toe) >= 0.08. Central differences with a step of 1e-5 leave 1e-10/6 and 1e-16/1e-5. The
    // sphere's rate divides by the square of the interior margin, which can be small in a random
    // device.
    let bounds = [1e-14, 1e-12, 1e-9, 1e-9, 1e-12];
    let mut table = vec![row(["quantity", "worst difference", "bound"])];
    for ((name, worst), bound) in names.iter().zip(worst).zip(bounds) {
        report.figure(format!("kinematics_{name}_worst_error"), worst);
        table.push(row([&name.replace('_', " "), &format!("{worst:.1e}"), &format!("{bound:.0e}")]));
        report.check(
            format!("{}: within {bound:.0e} of the paper's velocity equations", name.replace('_', " ")),
            format!("{worst:.1e}"),
            worst < bound,
        );
    }
    report.table(&table);
}

/// Returns the differences between the core and an independent derivation of the kinematics, for
/// one device and one posture. There are five: of the contact frames, the joint rates, the rate of
/// the frames, the sphere's rate, and the slip.
fn one(device: &Device, th: &[f64], omega: Vec3) -> [f64; 5] {
    let posture = Posture::new(device, th);
    let found = posture.inverse(omega);
    let mut worst = [0.0_f64; 5];
    let mut expected = Vec::new();
    for (i, (wheel, th)) in device.wheels().iter().zip(th).enumerate() {
        let first = least_rotation(wheel.spec().axis);
        let c = frame(wheel.spec(), first, *th);
        let ours = posture.frames()[i];
        for (a, b) in [(c.x_axis, ours.c1), (c.y_axis, ours.c2), (c.z_axis, ours.c3)] {
            worst[0] = worst[0].max((a - b).length());
        }
        expected.extend(rates(device, wheel, c, omega));
        // Compares the rate of the wheel's centre by eq. 4 with a difference quotient.
        let step = 1.0e-5;
        let moved = (frame(wheel.spec(), first, th + step).z_axis
            - frame(wheel.spec(), first, th - step).z_axis)
            / (2.0 * step);
        worst[2] = worst[2].max((moved - wheel.spec().axis.cross(c.z_axis)).length());
    }
    let largest = expected.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
    for (a, b) in expected.iter().zip(found) {
        worst[1] = worst[1].max((a - b).abs() / largest);
    }
    let back = posture.forward(device, &expected);
    worst[3] = (back.omega - omega).length() / omega.length();
    let slip = back.slip[..th.len()].iter().flatten().fold(0.0_f64, |most, slip| most.max(slip.abs()));
    worst[4] = slip / (device.sphere_radius() * omega.length());
    worst
}

/// Checks that equations 12 and 13 of the paper use the angular velocity in frame N, not the one in
/// body axes. The check uses a constant rate.
fn propagation(report: &mut Report) {
    let start = rotation::exp(Vec3::new(0.5, -0.8, 0.3));
    let omega = Vec3::new(1.1, 0.4, -0.7);
    let rate = |q: Quat| {
        let (eta, e) = (q.w, vector_part(q));
        from_parts(-0.5 * e.dot(omega), (omega * eta - e.cross(omega)) * 0.5)
    };
    let h = 1.0e-3;
    let q = (0..1000).fold(start, |q, _| {
        let k1 = rate(q);
        let k2 = rate(q + k1 * (0.5 * h));
        let k3 = rate(q + k2 * (0.5 * h));
        let k4 = rate(q + k3 * h);
        q + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0)
    });
    let inertial = rotation::angle_between(q, rotation::exp(omega) * start);
    let body = rotation::angle_between(q, start * rotation::exp(omega));
    report.family("propagation_{frame}_error_rad | rad | how far eq. 12 and 13, integrated for 1 s at a constant rate, end from a turn at that rate in {frame}: inertial or body");
    report.figure("propagation_inertial_error_rad".to_owned(), inertial);
    report.figure("propagation_body_error_rad".to_owned(), body);
    report.say(&format!(
        "Equations 12 and 13 say *body angular velocity*; their signs are those of the rate in N. Integrated for 1 s at a constant rate they end {inertial:.0e} rad from the turn with that rate in N, \
         and {} rad from the one with it in the sphere's axes.",
        short(body)
    ));
    report.check(
        "eq. 12 and 13 take the rate in N (to 1e-11 rad; of the body it would be off by more than 0.1)",
        format!("{inertial:.1e}, {body:.2}"),
        inertial < 1.0e-11 && body > 0.1,
    );
}

/// Shows that equation 1 of the paper, taken literally, puts the contacts of both wheels of the
/// prototype at one point.
fn literal(report: &mut Report) {
    type First = fn(Vec3) -> Mat3;
    let device = RigConfig::prototype().rig.device;
    let c3 = |first: First, th: [f64; 2]| -> [Vec3; 2] {
        core::array::from_fn(|k| {
            let wheel = &device.wheels()[k];
            frame(wheel.spec(), first(wheel.spec().axis), th[k]).z_axis
        })
    };
    let angle = |[a, b]: [Vec3; 2]| libm::atan2(a.cross(b).length(), a.dot(b));
    let margin = |[a, b]: [Vec3; 2]| {
        // sqrt(1 - |cos g|) for the angle g between the lines through the contacts, without
        // cancellation.
        let g = angle([a, b]);
        core::f64::consts::SQRT_2 * libm::sin(0.5 * g.min(core::f64::consts::PI - g))
    };
    let (letter, ours): (First, First) = (|_| Mat3::IDENTITY, least_rotation);
    let zero = [0.0; 2];
    let at_zero = [letter, ours].map(|first| angle(c3(first, zero)));
    let over_all = [letter, ours].map(|first| torus::least(60, |th| margin(c3(first, th))).1);
    let there = [letter, ours].map(|first| margin(c3(first, zero)));
    tell_readings(report, at_zero, there, over_all);
    let core = [interior_margin(&Posture::new(&device, &zero)), interior_margin_over_all(&device)];
    let found = [there[1], over_all[1]];
    let off = (core[0] - found[0]).abs().max((core[1] - found[1]).abs());
    report.check(
        "eq. 1 to the letter puts both contact points in one place at zero, A0 first keeps them apart",
        format!("{:.1e} and {:.3} rad", at_zero[0], at_zero[1]),
        at_zero[0] < 1.0e-15 && at_zero[1] > 1.0,
    );
    // The search stops at 1e-9 of a cell, and the margin is flat there.
    report.check(
        "the core's margins are those of the matrices, to 1e-12",
        format!("{off:.1e}"),
        off < 1.0e-12,
    );
    report.compare(
        "contact points at steering angles of zero (eq. 1, table I)",
        "never collocated",
        format!(
            "{:.0} deg apart, never nearer than {:.0} deg; to the letter of eq. 1: {:.0} deg",
            at_zero[1].to_degrees(),
            2.0 * libm::asin(over_all[1] / core::f64::consts::SQRT_2).to_degrees(),
            at_zero[0].to_degrees()
        ),
        "Eq. 1 leaves out the rotation that takes n3 to the steering axis.",
    );
}

/// Reports how two interpretations of eq. 1 of the paper differ for the prototype. Each array has
/// two values: first for the literal interpretation, then for this project's. `at_zero` is the
/// angle between the two contacts at steer angles of zero, `there` is the margin to singularity at
/// these angles, and `over_all` is the smallest margin over all steer angles.
fn tell_readings(report: &mut Report, at_zero: [f64; 2], there: [f64; 2], over_all: [f64; 2]) {
    report.family("eq1_{reading}_contacts_apart_rad | rad | angle between the contact points of the prototype at steering angles of zero; {reading}: literal (A = N there) or ours (A takes n3 to l first)");
    report.family("eq1_{reading}_margin_{where} | 1 | sigma_min(Z)/R of the prototype; {reading} likewise; {where}: at_zero, or least over all steering angles");
    let mut table = vec![head(
        "reading of eq. 1 | contact points apart at th = 0, deg | margin there | least margin over all steering angles",
    )];
    for (k, (id, name)) in [("literal", "to the letter"), ("ours", "A0 first")].iter().enumerate() {
        report.figure(format!("eq1_{id}_contacts_apart_rad"), at_zero[k]);
        report.figure(format!("eq1_{id}_margin_at_zero"), there[k]);
        report.figure(format!("eq1_{id}_margin_least"), over_all[k]);
        table.push(row([
            *name,
            &format!("{:.1}", at_zero[k].to_degrees()),
            &format!("{:.4}", there[k]),
            &format!("{:.4}", over_all[k]),
        ]));
    }
    report.say(
        "Equation 1 begins with the rotation about the steering axis by the steering angle and nothing before it. To the letter that leaves A = N at a steering angle of zero, whatever the axis, so both wheels of \
         table I start at the same point of the sphere: the interior singularity that the paper rules out. Here A takes n3 to the axis first, and then its claims hold.",
    );
    report.table(&table);
}

/// Draws the prototype with its axes, wheels and contact frames.
fn sketch(device: &Device) -> Sketch {
    let mut sketch = Sketch::new("Hbot prototype, from the side and below", -78.0, -24.0);
    for (axis, name) in [(Vec3::X, "n1"), (Vec3::Y, "n2"), (Vec3::Z, "n3")] {
        sketch.named(Vec3::ZERO, axis * 1.3, name, Pen::Thin);
    }
    let th = [130.0_f64, 35.0].map(f64::to_radians);
    let posture = Posture::new(device, &th);
    for (k, (wheel, frame)) in device.wheels().iter().zip(posture.frames()).enumerate() {
        let axis = wheel.spec().axis;
        sketch.named(Vec3::ZERO, axis * 1.6, &format!("l{}", k + 1), Pen::Strong(6));
        sketch.circle(axis, wheel.spec().cone, Pen::Thin);
        wheel_at(&mut sketch, device, k, frame.c3, frame.c1, k);
        for (c, name, length) in [(frame.c1, "c1", 0.5), (frame.c2, "c2", 0.5), (frame.c3, "c3", 0.75)] {
            sketch.named(frame.c3, frame.c3 + c * length, name, Pen::Strong(k));
        }
    }
    sketch
}

/// Draws one wheel of a device as a circle that touches the sphere at the point `contact`.
pub(super) fn wheel_at(
    sketch: &mut Sketch,
    device: &Device,
    wheel: usize,
    contact: Vec3,
    axle: Vec3,
    colour: usize,
) {
    let r = device.wheels()[wheel].spec().radius / device.sphere_radius();
    let centre = contact * (1.0 + r);
    let rim = |k: u32| {
        let turned = about(axle, f64::from(k) * core::f64::consts::TAU / 24.0) * contact;
        centre - turned * r
    };
    sketch.line((0..=24).map(rim).collect(), Pen::Strong(colour));
    sketch.dot(contact, colour);
}
