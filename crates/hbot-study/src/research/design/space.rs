//! The designs that are looked at: what varies, what stays the prototype's, and whether the modules have room.

use core::f64::consts::{FRAC_PI_2, TAU};

use hbot_config::RigConfig;
use hbot_core::{Device, Rig, Vec3, WheelSpec};

/// Mass at the centre of a wheel: wheel, fork, drive motor and gear, kg; what the simulated rig assumes too.
pub(super) const MODULE_MASS: f64 = 0.05;
/// Of it the wheel, a disc of this width, m, ...
pub(super) const WHEEL_WIDTH: f64 = 0.006;
/// ... and this density, kg/m³.
pub(super) const WHEEL_DENSITY: f64 = 1200.0;
/// What a module needs beyond the rim of its wheel, m: tyre, fork, play.
pub(super) const MODULE_ROOM: f64 = 0.005;
/// How far below the equator modules stay, rad: the open half and the cage's ring are there.
pub(super) const BELOW_EQUATOR: f64 = 5.0 * DEGREE;

/// rad
pub(super) const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// Steps of what varies: nobody builds closer. Angles in rad, the radius in m.
const STEP: [f64; 4] = [0.1 * DEGREE, 0.1 * DEGREE, 0.1 * DEGREE, 1.0e-4];
/// From where to where, in those steps: cone, toe, tilt, radius.
///
/// A cone below 6 deg has a wheel steered ten times as fast as the sphere turns; above 40 deg no module has room. A toe of either sign
/// is the mirror image of the other. Axes straight down meet in one point; those near the equator leave the open half no room.
/// A wheel below 8 mm leaves no room for a motor on its axle; above 30 mm its module is as wide as the cage.
const RANGE: [[u32; 2]; 4] = [[60, 400], [0, 400], [150, 800], [80, 300]];

/// Wheel counts that are looked at.
pub(super) const WHEELS: [usize; 3] = [2, 3, 4];

/// A design on the grid of what can be built: cone, toe, tilt and wheel radius in steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Point {
    pub(super) wheels: usize,
    pub(super) at: [u32; 4],
}

impl Point {
    /// The nearest to a place in the unit cube; what is outside comes to its faces.
    pub(super) fn nearest(wheels: usize, unit: [f64; 4]) -> Self {
        let at = core::array::from_fn(|k| {
            let [low, high] = RANGE[k].map(f64::from);
            (low + (high - low) * unit[k].clamp(0.0, 1.0)).round() as u32
        });
        Self { wheels, at }
    }

    /// The nearest to a design.
    pub(super) fn of(design: &Design) -> Self {
        let values = [design.cone, design.toe, design.tilt, design.radius];
        let unit = core::array::from_fn(|k| {
            let [low, high] = RANGE[k].map(f64::from);
            (values[k] / STEP[k] - low) / (high - low)
        });
        Self::nearest(design.wheels, unit)
    }

    /// So many steps away; `None` outside the ranges.
    pub(super) fn moved(&self, steps: [i32; 4]) -> Option<Self> {
        let mut at = self.at;
        for k in 0..4 {
            at[k] = at[k].checked_add_signed(steps[k])?;
            if !(RANGE[k][0]..=RANGE[k][1]).contains(&at[k]) {
                return None;
            }
        }
        Some(Self { at, ..*self })
    }

    /// Its place in the unit cube.
    pub(super) fn unit(&self) -> [f64; 4] {
        core::array::from_fn(|k| {
            let [low, high] = RANGE[k].map(f64::from);
            (f64::from(self.at[k]) - low) / (high - low)
        })
    }

    pub(super) fn design(&self) -> Design {
        let [cone, toe, tilt] = core::array::from_fn(|k| f64::from(self.at[k]) * STEP[k]);
        // A quotient is the number that the decimals mean.
        let radius = f64::from(self.at[3]) / 1.0e4;
        Design { wheels: self.wheels, cone, toe, tilt, radius }
    }
}

/// A design: so many wheels spread evenly about n3, all alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Design {
    /// 2 to 8.
    pub(super) wheels: usize,
    /// Cone angle a, rad.
    pub(super) cone: f64,
    /// Toe angle b, rad.
    pub(super) toe: f64,
    /// Angle of the steering axes from -n3, rad.
    pub(super) tilt: f64,
    /// Wheel radius r, m.
    pub(super) radius: f64,
}

/// What every design has of the prototype: sphere, motors, encoders, limits.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    pub(super) rig: Rig,
    pub(super) prototype: Design,
    /// Inertia about a steering axis of what does not move with the cone: the rotor, kg m².
    steer_rotor: f64,
    /// Inertia about an axle but the wheel's own: the rotor through its gear, kg m².
    drive_rotor: f64,
}

impl Parts {
    /// Those of `rigs/prototype.toml`.
    pub(super) fn prototype() -> Self {
        let rig = RigConfig::prototype().rig;
        let spec = rig.device.wheels()[0].spec();
        let prototype = Design {
            wheels: rig.device.wheels().len(),
            cone: spec.cone,
            toe: spec.toe,
            tilt: libm::acos(-spec.axis.z),
            radius: spec.radius,
        };
        let arm = (rig.device.sphere_radius() + spec.radius) * libm::sin(spec.cone);
        Self {
            rig,
            prototype,
            steer_rotor: spec.steer_inertia - MODULE_MASS * arm * arm,
            drive_rotor: spec.drive_inertia - disc_inertia(spec.radius),
        }
    }

    /// The sphere's radius R, m.
    pub(super) fn sphere_radius(&self) -> f64 {
        self.rig.device.sphere_radius()
    }

    /// Inertia about the steering axis: the rotor, and the module on its arm (R + r) sin a, kg m².
    pub(super) fn steer_inertia(&self, design: &Design) -> f64 {
        let arm = (self.sphere_radius() + design.radius) * libm::sin(design.cone);
        let module = MODULE_MASS + disc_mass(design.radius) - disc_mass(self.prototype.radius);
        self.steer_rotor + module * arm * arm
    }

    /// Inertia about the axle: the rotor through its gear, and the wheel, kg m².
    pub(super) fn drive_inertia(&self, design: &Design) -> f64 {
        self.drive_rotor + disc_inertia(design.radius)
    }

    /// The device of a design; `None` where it can become singular.
    pub(super) fn device(&self, design: &Design) -> Option<Device> {
        let specs: Vec<WheelSpec> = (0..design.wheels)
            .map(|k| WheelSpec {
                axis: design.axis(k),
                cone: design.cone,
                toe: design.toe,
                radius: design.radius,
                steer_inertia: self.steer_inertia(design),
                drive_inertia: self.drive_inertia(design),
                axial_inertia: 0.0,
            })
            .collect();
        Device::new(self.sphere_radius(), self.rig.device.sphere_mass(), &specs).ok()
    }
}

impl Design {
    /// The steering axis of wheel `k` in N.
    pub(super) fn axis(&self, k: usize) -> Vec3 {
        let (s, c) = libm::sincos(TAU * k as f64 / self.wheels as f64);
        let (tilt_s, tilt_c) = libm::sincos(self.tilt);
        Vec3::new(tilt_s * c, tilt_s * s, -tilt_c)
    }

    /// Half-angle of the cone about its axis, seen from the sphere's centre, that a module sweeps, rad: the rim's far edge with room
    /// about it. The steering motor behind it is inside.
    pub(super) fn swept(&self, sphere_radius: f64) -> f64 {
        self.cone + libm::asin((self.radius + MODULE_ROOM) / (sphere_radius + self.radius))
    }

    /// What is left between the modules of two neighbours, whatever they steer to, rad.
    pub(super) fn gap(&self, sphere_radius: f64) -> f64 {
        let turn = libm::sin(core::f64::consts::PI / self.wheels as f64);
        let between = 2.0 * libm::asin(libm::sin(self.tilt) * turn);
        between - 2.0 * self.swept(sphere_radius)
    }

    /// What is left between the modules and the rim that they stay below, rad.
    pub(super) fn headroom(&self, sphere_radius: f64) -> f64 {
        FRAC_PI_2 - BELOW_EQUATOR - self.tilt - self.swept(sphere_radius)
    }

    /// How fast a wheel is steered at worst, for a sphere that turns at 1: |g_th| = 1/(sin a cos b).
    pub(super) fn steering_speed(&self) -> f64 {
        1.0 / (libm::sin(self.cone) * libm::cos(self.toe))
    }

    /// How fast a wheel is driven at worst, for a sphere that turns at 1: |g_ph| = R/(r cos b).
    pub(super) fn drive_speed(&self, sphere_radius: f64) -> f64 {
        sphere_radius / (self.radius * libm::cos(self.toe))
    }
}

fn disc_mass(radius: f64) -> f64 {
    WHEEL_DENSITY * WHEEL_WIDTH * core::f64::consts::PI * radius * radius
}

fn disc_inertia(radius: f64) -> f64 {
    0.5 * disc_mass(radius) * radius * radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_core::kinematics::Posture;
    use hbot_core::singularity::{Meeting, closest_approach};

    /// The prototype's geometry comes out of the design as the rig file has it.
    #[test]
    fn the_prototype_is_one_of_the_designs() {
        let parts = Parts::prototype();
        let device = parts.device(&parts.prototype).expect("legal");
        for (made, given) in device.wheels().iter().zip(parts.rig.device.wheels()) {
            let (made, given) = (made.spec(), given.spec());
            // Rounding of a few elementary functions.
            assert!((made.axis - given.axis).length() < 1e-15);
            assert_eq!((made.cone, made.toe, made.radius), (given.cone, given.toe, given.radius));
            assert!((made.steer_inertia / given.steer_inertia - 1.0).abs() < 1e-14);
            assert!((made.drive_inertia / given.drive_inertia - 1.0).abs() < 1e-14);
        }
        // Both splits leave a rotor: the module's mass and the wheel's size are not too large for the inertias assumed.
        assert!(parts.steer_rotor > 0.0 && parts.drive_rotor > 0.0);
    }

    /// A module on its arm is felt at the sphere as its mass at R + r, whatever the cone: the arm grows as the leverage falls.
    #[test]
    fn a_module_weighs_the_same_at_any_cone() {
        let parts = Parts::prototype();
        let felt = |cone: f64| {
            let design = Design { cone, ..parts.prototype };
            let leverage = design.steering_speed();
            (parts.steer_inertia(&design) - parts.steer_rotor) * leverage * leverage
        };
        let mass = MODULE_MASS * 0.1175 * 0.1175;
        for cone in [0.05, 0.1745, 0.6] {
            assert!((felt(cone) / mass - 1.0).abs() < 1e-12, "{}", felt(cone));
        }
        // A wheel twice as large weighs four times as much, and has sixteen times the inertia.
        let large = Design { radius: 2.0 * parts.prototype.radius, ..parts.prototype };
        let [own, other] = [&parts.prototype, &large].map(|d| parts.drive_inertia(d) - parts.drive_rotor);
        assert!((other / own - 16.0).abs() < 1e-9);
    }

    /// The rows of G are nowhere longer than the closed forms say, and somewhere as long, with and without toe.
    #[test]
    fn joint_speeds_are_their_closed_forms_at_any_posture() {
        let parts = Parts::prototype();
        let design = Design { wheels: 3, cone: 0.3, toe: 0.5, tilt: 0.9, radius: 0.012 };
        let device = parts.device(&design).expect("legal");
        for k in 0..50 {
            let th = [0.1 * k as f64, 2.0 - 0.3 * k as f64, 0.7 * k as f64];
            for rows in Posture::new(&device, &th).rows().chunks(2) {
                let drive = design.drive_speed(parts.sphere_radius());
                assert!((rows[0].length() / design.steering_speed() - 1.0).abs() < 1e-14);
                assert!((rows[1].length() / drive - 1.0).abs() < 1e-14);
            }
        }
    }

    /// Modules that do not touch keep their contact points at least their own widths apart.
    #[test]
    fn room_between_modules_is_room_between_contacts() {
        let parts = Parts::prototype();
        let r = parts.sphere_radius();
        for wheels in WHEELS {
            let design = Design { wheels, tilt: 0.9, ..parts.prototype };
            let device = parts.device(&design).expect("legal");
            let wheels = device.wheels();
            let apart = closest_approach(&wheels[0], &wheels[1], Meeting::Collocated);
            let width = design.swept(r) - design.cone;
            assert!((apart - design.gap(r) - 2.0 * width).abs() < 1e-12);
        }
    }

    #[test]
    fn places_in_the_cube_are_points_of_the_grid() {
        let point = Point { wheels: 3, at: [123, 45, 547, 155] };
        assert_eq!(Point::nearest(3, point.unit()), point);
        assert_eq!(Point::of(&point.design()), point);
        assert_eq!(point.moved([1, -45, 0, -2]).map(|p| p.at), Some([124, 0, 547, 153]));
        assert_eq!(point.moved([0, -46, 0, 0]), None);
        assert_eq!(point.moved([0, 0, 0, 146]), None);
        assert_eq!(Point::nearest(3, [-1.0, 2.0, 0.0, 1.0]).at, [60, 400, 150, 300]);
        let design = point.design();
        assert!((design.tilt - 54.7 * DEGREE).abs() < 1e-15 && (design.radius - 0.0155).abs() < 1e-15);
    }
}
