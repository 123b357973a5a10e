//! Designs: which are legal, which are refused and why, and the constants of a wheel (physics
//! notes, sections 1 to 3).

use crate::designs::device_and_steering;
use crate::prelude::*;
use hbot_core::design::device::DeviceError;
use hbot_core::design::singularity::{Meeting, boundary_determinant, singular_values};
use hbot_testing::prototype::wheels as prototype_wheels;
use proptest::prelude::*;

proptest! {
    #[test]
    fn contact_frames_are_rotations_and_the_axis_keeps_its_place_in_them((device, theta) in device_and_steering()) {
        let posture = Posture::new(&device, &theta);
        for (wheel, f) in device.wheels().iter().zip(posture.frames()) {
            let (l, a, b) = (wheel.spec().axis, wheel.spec().cone, wheel.spec().toe);
            // The tolerance is the rounding of sums of a dozen products of sines.
            let near = |x: f64, y: f64| (x - y).abs() < 32.0 * f64::EPSILON;
            prop_assert!(near(l.dot(f.c1), a.sin() * b.sin()));
            prop_assert!(near(l.dot(f.c2), a.sin() * b.cos()));
            prop_assert!(near(l.dot(f.c3), a.cos()));
            prop_assert!(near(f.c1.dot(f.c2), 0.0) && near(f.c1.length(), 1.0) && near(f.c2.length(), 1.0));
            prop_assert!((f.c1.cross(f.c2) - f.c3).length() < 32.0 * f64::EPSILON);
            let det = boundary_determinant(&device, wheel);
            let want = wheel.spec().radius * device.sphere_radius() * a.sin() * b.cos();
            prop_assert!((det - want).abs() <= 8.0 * f64::EPSILON * want);
        }
    }

    #[test]
    fn two_wheels_have_the_eigenvalues_2_and_1_plus_minus_cos_g((device, theta) in device_and_steering()) {
        let posture = Posture::new(&device, &theta);
        let [a, b] = [posture.frames()[0], posture.frames()[1]];
        let [s1, s2, s3] = singular_values(&[-a.c2, a.c1, -b.c2, b.c1]);
        let c = a.c3.dot(b.c3).abs();
        // Singular values have the rounding of the largest one. Their squares are compared.
        let near = |s: f64, want: f64| (s * s - want).abs() < 64.0 * f64::EPSILON;
        prop_assert!(near(s1, 2.0) && near(s2, 1.0 + c) && near(s3, 1.0 - c), "{s1} {s2} {s3}, cos {c}");
    }
}

/// Returns steering axes at 0.1 rad down to zero from -n3, in several directions.
fn near_straight_down() -> impl Iterator<Item = Vec3> {
    let off = [0.1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-7, 3e-8, 1e-8, 1e-9, 1e-12, 1e-16, 1e-30, 1e-200, 0.0];
    off.into_iter().flat_map(|off| {
        (0..7).map(move |k| {
            let (s, c) = f64::from(k).sin_cos();
            Vec3::new(off * c, off * s, -1.0)
        })
    })
}

#[test]
fn an_axis_near_straight_down_still_makes_contact_frames() {
    for axis in near_straight_down() {
        let [mut down, mut side] = prototype_wheels();
        down.axis = axis;
        side.axis = Vec3::X;
        let device = Device::new(0.102, 0.467, &[down, side]).unwrap();
        for theta in [0.0, 0.7, -2.9] {
            let posture = Posture::new(&device, &[theta, 0.3]);
            let f = posture.frames()[0];
            let (l, a) = (device.wheels()[0].spec().axis, down.cone);
            let off = [
                (l.dot(f.c2) - a.sin()).abs(),
                (l.dot(f.c3) - a.cos()).abs(),
                l.dot(f.c1).abs(),
                (f.c1.cross(f.c2) - f.c3).length(),
                f.c1.dot(f.c2).abs(),
                (f.c1.length() - 1.0).abs(),
                (f.c2.length() - 1.0).abs(),
            ];
            assert!(off.iter().all(|x| *x < 16.0 * f64::EPSILON), "{axis:?}, {theta}: {off:?}");
        }
    }
}

/// The 32-bit version of the test above. Squares underflow sooner in 32 bits.
#[test]
fn an_axis_near_straight_down_still_makes_contact_frames_in_32_bits() {
    use hbot_core_f32::{Device, Vec3, WheelSpec, design::kinematics::Posture};
    for axis in near_straight_down() {
        let [down, side] = [axis.as_vec3(), Vec3::X].map(|axis| WheelSpec {
            axis,
            cone: 0.1745,
            toe: 0.0,
            radius: 0.0155,
            steer_inertia: 0.0,
            drive_inertia: 0.0,
            axial_inertia: 0.0,
        });
        let device = Device::new(0.102, 0.467, &[down, side]).unwrap();
        let posture = Posture::new(&device, &[0.7, 0.3]);
        let (f, l) = (posture.frames()[0], device.wheels()[0].spec().axis);
        let off = [
            (l.dot(f.c2) - 0.1745_f32.sin()).abs(),
            l.dot(f.c1).abs(),
            (f.c1.cross(f.c2) - f.c3).length(),
            (f.c1.length() - 1.0).abs(),
        ];
        assert!(off.iter().all(|x| *x < 16.0 * f32::EPSILON), "{axis:?}: {off:?}");
    }
}

#[test]
fn straight_down_is_a_half_turn_about_n1() {
    let [mut down, mut side] = prototype_wheels();
    (down.axis, side.axis) = (-Vec3::Z, Vec3::X);
    let device = Device::new(0.102, 0.467, &[down, side]).unwrap();
    let (s, c) = (down.cone.sin(), down.cone.cos());
    let f = Posture::new(&device, &[0.0, 0.0]).frames()[0];
    for (got, want) in [(f.c1, Vec3::X), (f.c2, Vec3::new(0.0, -c, -s)), (f.c3, Vec3::new(0.0, s, -c))] {
        assert!((got - want).length() < 4.0 * f64::EPSILON, "{got} against {want}");
    }
}

fn altered(wheel: usize, alter: impl Fn(&mut WheelSpec)) -> Result<Device, DeviceError> {
    let mut wheels = prototype_wheels();
    alter(&mut wheels[wheel]);
    Device::new(0.102, 0.467, &wheels)
}

/// Asserts that a design is refused. Errors are compared as text, because a NaN does not equal
/// itself.
#[track_caller]
fn refused(design: Result<Device, DeviceError>, error: DeviceError, says: &str) {
    let got = design.expect_err(says);
    assert_eq!(format!("{got:?}"), format!("{error:?}"));
    assert!(got.to_string().contains(says), "\"{got}\" does not say \"{says}\"");
}

#[test]
fn every_reason_to_refuse_a_design_names_the_wheel() {
    use core::f64::consts::{FRAC_PI_2, PI};
    for wheel in [0, 1] {
        let name = format!("wheel {}", wheel + 1);
        for axis in [Vec3::ZERO, Vec3::new(f64::NAN, 0.0, 1.0), Vec3::new(0.0, f64::INFINITY, 1.0)] {
            refused(altered(wheel, |w| w.axis = axis), DeviceError::Axis { wheel }, &name);
        }
        for value in [0.0, -0.1, PI, 4.0, f64::NAN, f64::INFINITY] {
            refused(altered(wheel, |w| w.cone = value), DeviceError::Cone { wheel, value }, &name);
        }
        for value in [FRAC_PI_2, -FRAC_PI_2, 2.0, f64::NAN] {
            refused(altered(wheel, |w| w.toe = value), DeviceError::Toe { wheel, value }, &name);
        }
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            refused(altered(wheel, |w| w.radius = value), DeviceError::WheelRadius { wheel, value }, &name);
        }
        for value in [-1e-9, f64::NAN, f64::INFINITY] {
            let error = DeviceError::Inertia { wheel, value };
            refused(altered(wheel, |w| w.steer_inertia = value), error, &name);
            refused(altered(wheel, |w| w.drive_inertia = value), error, &name);
            refused(altered(wheel, |w| w.axial_inertia = value), error, &name);
        }
        let margin = 1e-7_f64.sin();
        refused(altered(wheel, |w| w.cone = 1e-7), DeviceError::BoundarySingular { wheel, margin }, &name);
    }
}

#[test]
fn designs_as_a_whole_are_refused_by_what_is_wrong_with_them() {
    let wheels = prototype_wheels();
    let [a, b] = wheels;
    refused(Device::new(0.1, 0.5, &[a]), DeviceError::WheelCount(1), "1 wheels");
    refused(Device::new(0.1, 0.5, &[a; 9]), DeviceError::WheelCount(9), "2 to 8");
    for value in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        refused(Device::new(value, 0.5, &wheels), DeviceError::SphereRadius(value), "sphere radius");
        refused(Device::new(0.1, value, &wheels), DeviceError::SphereMass(value), "sphere mass");
    }
    let error = DeviceError::InteriorSingular { wheels: [0, 1], meeting: Meeting::Collocated };
    refused(Device::new(0.1, 0.5, &[a, a]), error, "wheels 1 and 2");
    let opposite = WheelSpec { axis: -a.axis, ..a };
    let error = DeviceError::InteriorSingular { wheels: [0, 1], meeting: Meeting::Antipodal };
    refused(Device::new(0.1, 0.5, &[a, opposite]), error, "opposite");
    // A third wheel that stays clear of the other two makes the design legal.
    assert!(Device::new(0.1, 0.5, &[a, a, b]).is_ok());
}

#[test]
fn the_length_of_an_axis_does_not_matter() {
    for scale in [1e-300, 1e-20, 1.0, 1e20, 1e300] {
        let device = altered(0, |w| w.axis *= scale).unwrap();
        let axis = device.wheels()[0].spec().axis;
        assert!((axis - prototype_wheels()[0].axis.normalize()).length() < 4.0 * f64::EPSILON, "{scale}");
    }
}
