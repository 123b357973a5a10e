//! The space of designs: the dimensions that vary, the properties that stay the prototype's, and
//! the room for the wheel modules.

use core::f64::consts::{FRAC_PI_2, TAU};

use hbot_config::RigConfig;
use hbot_core::{Device, Rig, Vec3, WheelSpec};

/// Mass that is assumed at the centre of a wheel, kg: wheel, fork, drive motor and gear. The
/// simulated rig assumes this mass too.
pub(super) const MODULE_MASS: f64 = 0.05;
/// Assumed width of a wheel, m. The wheel is modelled as a disc.
pub(super) const WHEEL_WIDTH: f64 = 0.006;
/// Assumed density of a wheel, kg/m³.
pub(super) const WHEEL_DENSITY: f64 = 1200.0;
/// Space that a wheel module needs beyond the rim of its wheel, m: for tyre, fork and play.
pub(super) const MODULE_ROOM: f64 = 0.005;
/// Smallest angle between the wheel modules and the sphere's equator, rad. The modules stay below
/// it, because the open half and the ring of the cage are above.
pub(super) const BELOW_EQUATOR: f64 = 5.0 * DEGREE;

/// One degree in radians, for angles that are given in degrees.
pub(super) const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// Grid steps of cone, toe and tilt (rad) and of the wheel radius (m). Smaller differences could
/// not be built.
const STEP: [f64; 4] = [0.1 * DEGREE, 0.1 * DEGREE, 0.1 * DEGREE, 1.0e-4];
/// Ranges of cone, toe, tilt and wheel radius that are searched, in grid steps.
///
/// With a cone below 6 deg a wheel steers ten times as fast as the sphere turns; above 40 deg no
/// module has room. A negative toe is the mirror image of a positive one, so it is not searched.
/// Steering axes that point straight down meet in one point; those near the equator leave no room
/// for the open half. A wheel below 8 mm leaves no room for a motor on its axle; with one above 30
/// mm a module is as wide as the cage.
const RANGE: [[u32; 2]; 4] = [[60, 400], [0, 400], [150, 800], [80, 300]];

/// Numbers of wheels for which designs are searched.
pub(super) const WHEELS: [usize; 3] = [2, 3, 4];

/// A design with its cone, toe, tilt and wheel radius in whole grid steps, so that it can be built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Point {
    pub(super) wheels: usize,
    pub(super) at: [u32; 4],
}

impl Point {
    /// Returns the design on the grid that is nearest to a position in the unit cube. Each
    /// coordinate of the cube is one dimension, scaled to its range. A position outside is moved to
    /// the cube's surface.
    pub(super) fn nearest(wheels: usize, unit: [f64; 4]) -> Self {
        let at = core::array::from_fn(|k| {
            let [low, high] = RANGE[k].map(f64::from);
            (low + (high - low) * unit[k].clamp(0.0, 1.0)).round() as u32
        });
        Self { wheels, at }
    }

    /// Returns the design on the grid that is nearest to `design`.
    pub(super) fn of(design: &Design) -> Self {
        let values = [design.cone, design.toe, design.tilt, design.radius];
        let unit = core::array::from_fn(|k| {
            let [low, high] = RANGE[k].map(f64::from);
            (values[k] / STEP[k] - low) / (high - low)
        });
        Self::nearest(design.wheels, unit)
    }

    /// Returns the design whose dimensions differ by `steps` grid steps, or `None` if it is outside
    /// the ranges.
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

    /// Returns the position of this design in the unit cube: each dimension scaled to its range.
    pub(super) fn unit(&self) -> [f64; 4] {
        core::array::from_fn(|k| {
            let [low, high] = RANGE[k].map(f64::from);
            (f64::from(self.at[k]) - low) / (high - low)
        })
    }

    pub(super) fn design(&self) -> Design {
        let [cone, toe, tilt] = core::array::from_fn(|k| f64::from(self.at[k]) * STEP[k]);
        // The division gives the number nearest to the decimal value, which a product with 1e-4
        // does not.
        let radius = f64::from(self.at[3]) / 1.0e4;
        Design { wheels: self.wheels, cone, toe, tilt, radius }
    }
}

/// The dimensions of a device with identical wheels, spread evenly about n3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Design {
    /// Number of wheels, 2 to 8.
    pub(super) wheels: usize,
    /// Cone angle a of the wheels, rad.
    pub(super) cone: f64,
    /// Toe angle b of the wheels, rad.
    pub(super) toe: f64,
    /// Angle between the steering axes and -n3, rad.
    pub(super) tilt: f64,
    /// Radius r of the wheels, m.
    pub(super) radius: f64,
}

/// The parts that every design takes from the prototype: the sphere, the motors, the encoders and
/// the limits.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    pub(super) rig: Rig,
    pub(super) prototype: Design,
    /// Inertia of the steer motor's rotor about the steering axis, kg m². It does not depend on the
    /// cone.
    steer_rotor: f64,
    /// Inertia of the drive motor's rotor about the axle, through its gear and without the wheel,
    /// kg m².
    drive_rotor: f64,
}

impl Parts {
    /// Returns the parts of the prototype, from `rigs/prototype.toml`.
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

    /// Returns the sphere's radius R, m.
    pub(super) fn sphere_radius(&self) -> f64 {
        self.rig.device.sphere_radius()
    }

    /// Returns the inertia of a steer joint about its axis, kg m²: that of the rotor, and that of
    /// the module on its arm (R + r) sin a.
    pub(super) fn steer_inertia(&self, design: &Design) -> f64 {
        let arm = (self.sphere_radius() + design.radius) * libm::sin(design.cone);
        let module = MODULE_MASS + disc_mass(design.radius) - disc_mass(self.prototype.radius);
        self.steer_rotor + module * arm * arm
    }

    /// Returns the inertia of a drive joint about its axle, kg m²: that of the rotor through its
    /// gear, and that of the wheel.
    pub(super) fn drive_inertia(&self, design: &Design) -> f64 {
        self.drive_rotor + disc_inertia(design.radius)
    }

    /// Returns the device with the dimensions of `design`, or `None` if it can become singular.
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
    /// Returns the steering axis of wheel `k`, a unit vector in frame N.
    pub(super) fn axis(&self, k: usize) -> Vec3 {
        let (s, c) = libm::sincos(TAU * k as f64 / self.wheels as f64);
        let (tilt_s, tilt_c) = libm::sincos(self.tilt);
        Vec3::new(tilt_s * c, tilt_s * s, -tilt_c)
    }

    /// Returns the half-angle of the cone that a module sweeps about its steering axis, seen from
    /// the sphere's centre, rad. The cone contains the far edge of the rim and its clearance. The
    /// steering motor, which is behind the wheel, is inside this cone.
    pub(super) fn swept(&self, sphere_radius: f64) -> f64 {
        self.cone + libm::asin((self.radius + MODULE_ROOM) / (sphere_radius + self.radius))
    }

    /// Returns the angle that is left between the modules of two neighbouring wheels, whatever
    /// their steer angles, rad.
    pub(super) fn gap(&self, sphere_radius: f64) -> f64 {
        let turn = libm::sin(core::f64::consts::PI / self.wheels as f64);
        let between = 2.0 * libm::asin(libm::sin(self.tilt) * turn);
        between - 2.0 * self.swept(sphere_radius)
    }

    /// Returns the angle that is left between the modules and the rim of the cage above them, rad.
    pub(super) fn headroom(&self, sphere_radius: f64) -> f64 {
        FRAC_PI_2 - BELOW_EQUATOR - self.tilt - self.swept(sphere_radius)
    }

    /// Returns the largest steer rate relative to the sphere's angular speed: |g_th| = 1/(sin a cos
    /// b).
    pub(super) fn steering_speed(&self) -> f64 {
        1.0 / (libm::sin(self.cone) * libm::cos(self.toe))
    }

    /// Returns the largest drive rate relative to the sphere's angular speed: |g_ph| = R/(r cos b).
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
    use hbot_core::design::kinematics::Posture;
    use hbot_core::design::singularity::{Meeting, closest_approach};

    /// The prototype, expressed as a design, has the wheel geometry and inertias of its rig file.
    #[test]
    fn the_prototype_is_one_of_the_designs() {
        let parts = Parts::prototype();
        let device = parts.device(&parts.prototype).expect("legal");
        for (made, given) in device.wheels().iter().zip(parts.rig.device.wheels()) {
            let (made, given) = (made.spec(), given.spec());
            // The tolerance is the rounding of a few elementary functions.
            assert!((made.axis - given.axis).length() < 1e-15);
            assert_eq!((made.cone, made.toe, made.radius), (given.cone, given.toe, given.radius));
            assert!((made.steer_inertia / given.steer_inertia - 1.0).abs() < 1e-14);
            assert!((made.drive_inertia / given.drive_inertia - 1.0).abs() < 1e-14);
        }
        // Both rotors have a positive inertia: the assumed module mass and wheel size are not too
        // large for the inertias of the rig file.
        assert!(parts.steer_rotor > 0.0 && parts.drive_rotor > 0.0);
    }

    /// The inertia that a wheel module adds to the sphere is that of its mass at the distance R +
    /// r, at any cone angle: the leverage falls as the arm grows.
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
        // A wheel of twice the radius has four times the mass and sixteen times the inertia.
        let large = Design { radius: 2.0 * parts.prototype.radius, ..parts.prototype };
        let [own, other] = [&parts.prototype, &large].map(|d| parts.drive_inertia(d) - parts.drive_rotor);
        assert!((other / own - 16.0).abs() < 1e-9);
    }

    /// The largest joint rates equal their closed forms at every posture, also with toe. They are
    /// the lengths of the rows of G.
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

    /// The smallest angle between the contacts of two neighbouring wheels is the gap between their
    /// modules plus the width of the modules.
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
