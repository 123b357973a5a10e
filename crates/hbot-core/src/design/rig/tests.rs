use super::*;
use crate::design::device::WheelSpec;
use crate::real::Vec3;

fn parts() -> RigParts {
    let wheel = |side| WheelSpec { axis: Vec3::new(side, 0.0, -1.0), ..WheelSpec::default() };
    let device = Device::new(0.1, 0.5, &[wheel(1.0), wheel(-1.0)]).unwrap_or_else(|e| panic!("{e}"));
    RigParts::new(device).with_joints(Joint::new(4096, 1.0), Joint::new(4096, 0.2))
}

#[test]
fn a_count_turns_the_joint_by_a_share_of_the_gear_in_its_own_sense() {
    let mut joint = Joint { gear: 4.0, ..Joint::new(1000, 1.0) };
    // 4000 counts are one turn.
    assert_eq!(joint.counts(), 4000.0);
    assert!((joint.radians_per_count() - 1.570_796_3e-3).abs() < 1.0e-9);
    joint.reversed = true;
    assert!((joint.radians_per_count() + 1.570_796_3e-3).abs() < 1.0e-9);
}

/// A number of a rig, for tests of its range: its field name in errors, its permitted range, and a
/// function that sets it.
type Number = (&'static str, Range, fn(&mut RigParts, Real));

const NUMBERS: [Number; 21] = [
    ("gear", legal::GEAR, |rig, x| rig.joints[3].gear = x),
    ("peak", legal::PEAK, |rig, x| (rig.joints[3].peak, rig.joints[3].continuous) = (x, x)),
    ("limits.torque", legal::TORQUE, |rig, x| rig.limits.torque = x),
    ("limits.torque_rate", legal::TORQUE_RATE, |rig, x| rig.limits.torque_rate = x),
    ("limits.speed", legal::SPEED, |rig, x| rig.limits.speed = x),
    ("limits.slip", legal::SLIP, |rig, x| rig.limits.slip = x),
    ("limits.thermal_time", legal::THERMAL_TIME, |rig, x| rig.limits.thermal_time = Some(x)),
    ("limits.energy.burst", legal::BURST, |rig, burst| {
        rig.limits.energy = Some(EnergyLimit { burst, power: 1.0 });
    }),
    ("limits.energy.power", legal::POWER, |rig, power| {
        rig.limits.energy = Some(EnergyLimit { burst: 1.0, power });
    }),
    ("limits.traction.mu", legal::FRICTION, |rig, mu| {
        rig.limits.traction = Some(Traction { mu, normal_force: 1.0 });
    }),
    ("limits.traction.normal_force", legal::NORMAL_FORCE, |rig, normal_force| {
        rig.limits.traction = Some(Traction { mu: 1.0, normal_force });
    }),
    ("limits.enable_max_angle", legal::ENABLE_MAX_ANGLE, |rig, x| rig.limits.enable_max_angle = x),
    ("limits.align_rate", legal::ALIGN_RATE, |rig, x| rig.limits.align_rate = x),
    ("limits.reference_rate", legal::REFERENCE_RATE, |rig, x| rig.limits.reference_rate = x),
    ("methods.rate.cutoff_hz", legal::CUTOFF_HZ, |rig, cutoff_hz| {
        rig.methods.rate = RateEstimate::LowPass { cutoff_hz };
    }),
    ("methods.rate.acceleration", legal::ACCELERATION, |rig, acceleration| {
        rig.methods.rate = RateEstimate::Kalman { acceleration };
    }),
    ("methods.passivity.allowance", legal::ALLOWANCE, |rig, x| passive(rig).allowance = x),
    ("methods.passivity.store", legal::STORE, |rig, x| passive(rig).store = x),
    ("methods.passivity.damping", legal::DAMPING, |rig, x| passive(rig).damping = x),
    // The upper bound of the continuous torque is the joint's own peak.
    ("continuous", Range::above(0.0, 0.2, "N m"), |rig, x| rig.joints[3].continuous = x),
    ("limits.torque", legal::TORQUE, |rig, x| rig.limits = Limits { torque: x, ..Limits::WIDEST }),
];

fn passive(rig: &mut RigParts) -> &mut PassivityLimit {
    let usual = PassivityLimit::of(&rig.device, rig.timing.period_s());
    rig.methods.passivity.insert(usual)
}

#[test]
fn each_number_is_refused_outside_its_range_and_taken_at_its_bounds() {
    for (field, range, set) in NUMBERS {
        let with = |value: Real| {
            let mut rig = parts();
            set(&mut rig, value);
            Rig::new(rig)
        };
        let below = if range.above_least { range.least } else { range.least - 0.01 };
        for value in [below, range.most * 1.01, -1.0, Real::NAN, Real::INFINITY, Real::NEG_INFINITY] {
            let error = with(value).expect_err(field);
            assert_eq!((error.field, error.range), (field, range), "{value}");
            assert!(error.value == value || value.is_nan() && error.value.is_nan());
            assert_eq!(error.joint, (!field.contains('.')).then_some(3));
        }
        let least = match range {
            Range { above_least: false, least, .. } => least,
            Range { least: 0.0, most, .. } => most * 1.0e-6,
            Range { least, .. } => least * 1.01,
        };
        for value in [least, range.most] {
            assert!(with(value).is_ok(), "{field} = {value}: {:?}", with(value));
        }
    }
}

#[test]
fn each_count_is_refused_outside_its_range_and_taken_at_its_bounds() {
    type Count = (&'static str, u32, u32, fn(&mut RigParts, u32));
    let counts: [Count; 5] = [
        ("counts_per_turn", 4, 1 << 30, |rig, n| rig.joints[0].counts_per_turn = n),
        ("timing.timeout_ticks", 1, 1000, |rig, n| rig.timing.timeout_ticks = n),
        ("limits.max_age_ticks", 1, 1_000_000, |rig, n| rig.limits.max_age_ticks = n),
        ("methods.rate.tolerance_counts", 1, 1000, |rig, tolerance_counts| {
            rig.methods.rate = RateEstimate::AdaptiveWindow { tolerance_counts, longest_ticks: 32 };
        }),
        ("methods.rate.longest_ticks", 2, LONGEST_WINDOW, |rig, longest_ticks| {
            rig.methods.rate = RateEstimate::AdaptiveWindow { tolerance_counts: 1, longest_ticks };
        }),
    ];
    for (field, least, most, set) in counts {
        let with = |value: u32| {
            let mut rig = parts();
            set(&mut rig, value);
            Rig::new(rig).err().map(|error| error.field)
        };
        // Among the largest counts, f32 can represent only every 128th.
        for value in [least - 1, most + most / 100 + 1] {
            assert_eq!(with(value), Some(field), "{value}");
        }
        assert_eq!((with(least), with(most)), (None, None), "{field}");
    }
    for (period_ns, legal) in [(999, false), (1000, true), (1_000_000_000, true), (1_010_000_000, false)] {
        let timing = Timing { period_ns, ..Timing::default() };
        assert_eq!(Rig::new(RigParts { timing, ..parts() }).is_ok(), legal, "{period_ns}");
    }
}

#[test]
fn counts_of_a_turn_fit_the_counter_of_a_controller_whatever_makes_them() {
    let counts = |counts_per_turn: u32, gear: Real| {
        let mut rig = parts();
        (rig.joints[1].counts_per_turn, rig.joints[1].gear) = (counts_per_turn, gear);
        Rig::new(rig).err().map(|error| (error.joint, error.field))
    };
    assert_eq!(counts(1 << 30, 2.0), None);
    assert_eq!(counts(1 << 30, 2.01), Some((Some(1), "counts")));
    assert_eq!(counts(4, 0.9), Some((Some(1), "counts")));
}

#[test]
fn what_a_rig_does_not_have_is_not_looked_at() {
    let mut rig = parts();
    // The device has four joints, and the third has no motor.
    (rig.joints[4].gear, rig.joints[4].peak) = (Real::NAN, -1.0);
    (rig.joints[2].peak, rig.joints[2].continuous) = (0.0, -1.0);
    assert!(Rig::new(rig).is_ok());
    rig.joints[0].gear = Real::NAN;
    rig.limits.speed = 0.0;
    let mistakes = rig.mistakes().map(|mistake| (mistake.joint, mistake.field));
    assert!(mistakes.eq([(Some(0), "gear"), (Some(0), "counts"), (None, "limits.speed")]));
}

#[test]
fn a_rig_that_cannot_be_altered_stays_as_it_is() {
    let rig = Rig::new(parts()).unwrap_or_else(|e| panic!("{e}"));
    assert!(rig.with(|rig| rig.limits.torque = Real::NAN).is_err());
    let other = rig.with(|rig| rig.limits.torque = 0.1).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((rig.limits.torque, other.limits.torque), (0.9, 0.1));
}

#[test]
fn a_watchdog_outlasts_a_command_that_is_a_period_late() {
    for (period_ns, ms) in [(1_000_000, 2), (20_000_000, 40), (50_000, 1), (333_333, 1), (1_428_571, 3)] {
        assert_eq!(Timing { period_ns, ..Timing::default() }.least_watchdog_ms(), ms);
    }
}
