//! A valid Hbot: a sphere and 2 to 8 steered and driven wheels (physics notes, section 1).
//!
//! A [`Device`] can only be made by [`Device::new`], which checks the design over all steer angles.
//! So code that holds a `Device` needs no further checks. The wheels store constants, so that a
//! posture is computed with one sine and one cosine per wheel.
//!
//! ```
//! use hbot_core::design::kinematics::Posture;
//! use hbot_core::{Device, Vec3, WheelSpec};
//!
//! // Two wheels of 15.5 mm radius below a sphere of 102 mm radius and 467 g. Their steer axes are
//! // at 45 degrees to the vertical.
//! let wheel = |side| WheelSpec {
//!     axis: Vec3::new(side, 0.0, -1.0),
//!     cone: 0.1745,
//!     radius: 0.0155,
//!     ..WheelSpec::default()
//! };
//! let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)])?;
//! assert_eq!(device.joints(), 4);
//!
//! // Joint rates of a sphere that turns about n3 at 1 rad/s without slip, and back to the sphere.
//! let posture = Posture::new(&device, &[0.3, -0.2]);
//! let rates = posture.inverse(Vec3::Z);
//! let forward = posture.forward(&device, &rates);
//! assert!((forward.omega - Vec3::Z).length() < 1e-12);
//!
//! // With equal cones about one axis the contact points can meet, so the design is refused.
//! let error = Device::new(0.102, 0.467, &[wheel(1.0), wheel(1.0)]).unwrap_err();
//! let message = "wheels 1 and 2: their contact points can meet at one point";
//! assert!(error.to_string().starts_with(message));
//! # Ok::<(), hbot_core::design::device::DeviceError>(())
//! ```

use core::fmt;

use crate::count::{Any, Count};
pub use crate::count::{MAX_JOINTS, MAX_WHEELS};
use crate::design::singularity::{self, Meeting};
use crate::real::{Real, Vec3, sincos};

/// Smallest permitted value of sin a cos b for a wheel with cone angle a and toe angle b. Below it,
/// the steer and the drive joint move the contact in almost the same direction. The determinant of
/// the wheel's matrix H is r R sin a cos b.
pub const MIN_BOUNDARY: Real = 1.0e-6;

/// The design of one wheel, before it is checked by [`Device::new`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct WheelSpec {
    /// Direction of the steer axis in frame N. The axis goes through the sphere's centre. The
    /// vector can have any length except zero.
    pub axis: Vec3,
    /// Cone angle a between the steer axis and the line from the sphere's centre to the contact
    /// point, rad. Strictly between 0 and pi.
    pub cone: Real,
    /// Toe angle b: turn of the wheel about the contact normal, rad. Strictly between -pi/2 and
    /// pi/2.
    pub toe: Real,
    /// Wheel radius r, m.
    pub radius: Real,
    /// Inertia J_th of all parts that turn with the wheel about the steer axis, kg m².
    pub steer_inertia: Real,
    /// Inertia J_ph of the drive joint about the wheel's axle, kg m². It includes the inertia of
    /// the motor's rotor as seen through the gear.
    pub drive_inertia: Real,
    /// Inertia I_axial of the wheel alone about its axle, kg m². Usually left at 0. If the toe
    /// angle is not zero, this inertia couples the two joints by J_c = I_axial sin a sin b.
    pub axial_inertia: Real,
}

impl Default for WheelSpec {
    /// Returns a wheel of 10 mm radius straight below the sphere, with a cone angle of 0.26 rad (15
    /// degrees) and no inertia. Useful as a base for other wheels.
    fn default() -> Self {
        Self {
            axis: Vec3::new(0.0, 0.0, -1.0),
            cone: 0.26,
            toe: 0.0,
            radius: 0.01,
            steer_inertia: 0.0,
            drive_inertia: 0.0,
            axial_inertia: 0.0,
        }
    }
}

/// A wheel whose design has been checked, with constants from which its contact frame is computed
/// quickly.
///
/// At the steer angle th, each column of the contact frame is C(th) = `p` cos th + `q` sin th +
/// `s`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Wheel {
    spec: WheelSpec,
    pub(crate) p: [Vec3; 3],
    pub(crate) q: [Vec3; 3],
    pub(crate) s: [Vec3; 3],
    /// Component of the unit steer axis l along the wheel's axle: l.c1 = sin a sin b.
    pub(crate) axis_c1: Real,
    /// Component of the unit steer axis l along the rolling direction: l.c2 = sin a cos b.
    pub(crate) axis_c2: Real,
}

/// The design of a sphere and its wheels, after it has been checked. Lengths are in m, masses in
/// kg, axes in frame N.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Device {
    sphere_radius: Real,
    sphere_mass: Real,
    #[cfg_attr(feature = "exact", serde(deserialize_with = "crate::exact::count::<_, 2, MAX_WHEELS>"))]
    count: usize,
    wheels: [Wheel; MAX_WHEELS],
}

/// The reason why a design of a sphere and wheels is not valid. Fields count wheels from 0, but
/// messages for people count them from 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DeviceError {
    /// There are fewer than 2 or more than [`MAX_WHEELS`] wheels.
    WheelCount(usize),
    /// The sphere's radius is not a positive, finite number.
    SphereRadius(Real),
    /// The sphere's mass is not a positive, finite number.
    SphereMass(Real),
    /// A steer axis is zero or not finite.
    Axis {
        /// Index of the wheel, counted from 0.
        wheel: usize,
    },
    /// A cone angle is not strictly between 0 and pi.
    Cone {
        /// Index of the wheel, counted from 0.
        wheel: usize,
        /// The given angle, rad.
        value: Real,
    },
    /// A toe angle is not strictly between -pi/2 and pi/2.
    Toe {
        /// Index of the wheel, counted from 0.
        wheel: usize,
        /// The given angle, rad.
        value: Real,
    },
    /// A wheel radius is not a positive, finite number.
    WheelRadius {
        /// Index of the wheel, counted from 0.
        wheel: usize,
        /// The given radius, m.
        value: Real,
    },
    /// An inertia is negative or not finite.
    Inertia {
        /// Index of the wheel, counted from 0.
        wheel: usize,
        /// The given inertia, kg m².
        value: Real,
    },
    /// At this wheel, the steer and the drive joint move the contact in almost the same direction
    /// (boundary singularity): sin a cos b is below [`MIN_BOUNDARY`].
    BoundarySingular {
        /// Index of the wheel, counted from 0.
        wheel: usize,
        /// Value of sin a cos b for the wheel, with cone angle a and toe angle b.
        margin: Real,
    },
    /// At some steer angles, the contact points of all wheels lie on one line through the sphere's
    /// centre (interior singularity). The wheels then cannot turn the sphere about this line.
    InteriorSingular {
        /// Indices, counted from 0, of two wheels whose contact points can meet.
        wheels: [usize; 2],
        /// Whether the contact points can meet at one point or at opposite points of the sphere.
        meeting: Meeting,
    },
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::WheelCount(n) => write!(f, "{n} wheels: a device has 2 to {MAX_WHEELS}"),
            Self::SphereRadius(v) => write!(f, "sphere radius {v} m: must be a positive number"),
            Self::SphereMass(v) => write!(f, "sphere mass {v} kg: must be a positive number"),
            Self::Axis { wheel } => {
                write!(f, "wheel {}: the steering axis must be finite and not zero", wheel + 1)
            }
            Self::Cone { wheel, value } => {
                write!(f, "wheel {}: cone angle {value} rad: must lie strictly between 0 and pi", wheel + 1)
            }
            Self::Toe { wheel, value } => {
                write!(
                    f,
                    "wheel {}: toe angle {value} rad: must lie strictly between -pi/2 and pi/2",
                    wheel + 1
                )
            }
            Self::WheelRadius { wheel, value } => {
                write!(f, "wheel {}: radius {value} m: must be a positive number", wheel + 1)
            }
            Self::Inertia { wheel, value } => {
                write!(f, "wheel {}: inertia {value} kg m²: must be zero or positive", wheel + 1)
            }
            Self::BoundarySingular { wheel, margin } => write!(
                f,
                "wheel {}: singular by design: sin(cone) cos(toe) is {margin:e}, at least {MIN_BOUNDARY:e} is needed for \
                 steering and driving to be independent",
                wheel + 1
            ),
            Self::InteriorSingular { wheels: [i, j], meeting } => write!(
                f,
                "wheels {} and {}: their contact points can {} at some steering angles, and no other wheel prevents the \
                 singularity; tilt an axis or change a cone angle",
                i + 1,
                j + 1,
                match meeting {
                    Meeting::Collocated => "meet at one point",
                    Meeting::Antipodal => "come to lie opposite each other",
                }
            ),
        }
    }
}

impl core::error::Error for DeviceError {}

impl Device {
    /// Creates a device from the sphere's radius (m), its mass (kg) and 2 to 8 wheels. Checks that
    /// the design works at all steer angles.
    ///
    /// # Errors
    /// Returns the first reason why the design is not valid, in the order of the variants of
    /// [`DeviceError`].
    pub fn new(sphere_radius: Real, sphere_mass: Real, wheels: &[WheelSpec]) -> Result<Self, DeviceError> {
        if !(2..=MAX_WHEELS).contains(&wheels.len()) {
            return Err(DeviceError::WheelCount(wheels.len()));
        }
        if !positive(sphere_radius) {
            return Err(DeviceError::SphereRadius(sphere_radius));
        }
        if !positive(sphere_mass) {
            return Err(DeviceError::SphereMass(sphere_mass));
        }
        let first = Wheel::new(0, &wheels[0])?;
        let mut device =
            Self { sphere_radius, sphere_mass, count: wheels.len(), wheels: [first; MAX_WHEELS] };
        for (i, spec) in wheels.iter().enumerate().skip(1) {
            device.wheels[i] = Wheel::new(i, spec)?;
        }
        match singularity::interior_singularity(&device) {
            Some((wheels, meeting)) => Err(DeviceError::InteriorSingular { wheels, meeting }),
            None => Ok(device),
        }
    }

    /// Returns this device with the frame of wheel number `wheel` turned about its steer axis: at
    /// the joint angle zero, the wheel stands as it stood at the joint angle `angle` (rad).
    ///
    /// With it, a steering zero is exact although motor controllers count in whole steps. Returns
    /// the device as it is if it has no such wheel.
    #[must_use]
    pub fn with_steering_zero(mut self, wheel: usize, angle: Real) -> Self {
        if let Some(wheel) = self.wheels[..self.count].get_mut(wheel) {
            let (sin, cos) = sincos(angle);
            let (p, q) = (wheel.p, wheel.q);
            wheel.p = core::array::from_fn(|k| p[k] * cos + q[k] * sin);
            wheel.q = core::array::from_fn(|k| q[k] * cos - p[k] * sin);
        }
        self
    }

    /// Returns the sphere's radius R, m.
    #[inline]
    #[must_use]
    pub fn sphere_radius(&self) -> Real {
        self.sphere_radius
    }

    /// Returns the sphere's mass m, kg.
    #[must_use]
    pub fn sphere_mass(&self) -> Real {
        self.sphere_mass
    }

    /// Returns the inertia of the sphere about any axis through its centre, kg m². The sphere is a
    /// thin shell, so it is 2/3 m R².
    #[must_use]
    pub fn sphere_inertia(&self) -> Real {
        2.0 / 3.0 * self.sphere_mass * self.sphere_radius * self.sphere_radius
    }

    /// Returns the number of wheels, for loops whose length is known only at run time.
    #[inline]
    pub(crate) fn count(&self) -> Any {
        Any::new(self.count)
    }

    /// Returns the wheels of the device, 2 to 8.
    #[inline]
    #[must_use]
    pub fn wheels(&self) -> &[Wheel] {
        &self.wheels[..self.count]
    }

    /// Returns the first `count` wheels. For the number of wheels of the device, these are the same
    /// as [`wheels`](Self::wheels), but the compiler knows their number if it knows `count`.
    #[inline]
    pub(crate) fn first<C: Count>(&self, count: C) -> &[Wheel] {
        &self.wheels[..count.wheels()]
    }

    /// Returns the number of joints: two per wheel, steer then drive.
    #[inline]
    #[must_use]
    pub fn joints(&self) -> usize {
        2 * self.count
    }
}

impl Wheel {
    fn new(wheel: usize, spec: &WheelSpec) -> Result<Self, DeviceError> {
        use crate::real::{PI, fabs};
        let length = spec.axis.abs().max_element();
        if !(length > 0.0 && length.is_finite() && spec.axis.is_finite()) {
            return Err(DeviceError::Axis { wheel });
        }
        // Scaled by the largest component first, so that no square underflows or overflows.
        let axis = spec.axis / length;
        let axis = axis / crate::real::sqrt(axis.length_squared());
        if !(spec.cone > 0.0 && spec.cone < PI) {
            return Err(DeviceError::Cone { wheel, value: spec.cone });
        }
        if !(fabs(spec.toe) < 0.5 * PI) {
            return Err(DeviceError::Toe { wheel, value: spec.toe });
        }
        if !positive(spec.radius) {
            return Err(DeviceError::WheelRadius { wheel, value: spec.radius });
        }
        for value in [spec.steer_inertia, spec.drive_inertia, spec.axial_inertia] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(DeviceError::Inertia { wheel, value });
            }
        }
        let (sa, ca) = sincos(spec.cone);
        let (sb, cb) = sincos(spec.toe);
        if !(sa * cb >= MIN_BOUNDARY) {
            return Err(DeviceError::BoundarySingular { wheel, margin: sa * cb });
        }
        // The columns of Rx(a) Rz(b). A turn by th about z and then by A0 gives C.
        let columns =
            [Vec3::new(cb, ca * sb, sa * sb), Vec3::new(-sb, ca * cb, sa * cb), Vec3::new(0.0, -sa, ca)];
        let least = least_rotation(axis);
        let turn = |x: Real, y: Real| least[0] * x + least[1] * y;
        Ok(Self {
            spec: WheelSpec { axis, ..*spec },
            p: columns.map(|c| turn(c.x, c.y)),
            q: columns.map(|c| turn(-c.y, c.x)),
            s: columns.map(|c| axis * c.z),
            axis_c1: sa * sb,
            axis_c2: sa * cb,
        })
    }

    /// Returns the design of the wheel, with the steer axis scaled to unit length.
    #[inline]
    #[must_use]
    pub fn spec(&self) -> &WheelSpec {
        &self.spec
    }

    /// Returns the component of the unit steer axis l along the wheel's axle: l.c1 = sin a sin b.
    /// It does not depend on the steer angle.
    #[inline]
    #[must_use]
    pub fn axis_along_axle(&self) -> Real {
        self.axis_c1
    }

    /// Returns the component of the unit steer axis l along the rolling direction: l.c2 = sin a
    /// cos b. The determinant of the wheel's matrix H is r R times this value.
    #[inline]
    #[must_use]
    pub fn axis_along_roll(&self) -> Real {
        self.axis_c2
    }
}

fn positive(x: Real) -> bool {
    x > 0.0 && x.is_finite()
}

/// Largest value of 1 + l3 at which the unit steer axis l counts as pointing straight down. In the
/// 64-bit build, a difference of this size is lost in rounding. The 32-bit build uses the same
/// value, so that a steer angle of zero means the same direction in both builds.
const STRAIGHT_DOWN: Real = 1.0e-15;

/// Returns the first two columns of A0, the smallest rotation that takes the axis n3 to `l`. The
/// third column is `l` itself.
fn least_rotation(l: Vec3) -> [Vec3; 2] {
    // 1 + l3, without cancellation if l points down.
    let flat = l.x * l.x + l.y * l.y;
    let sum = if l.z < 0.0 { flat / (1.0 - l.z) } else { 1.0 + l.z };
    if sum <= STRAIGHT_DOWN {
        // A half turn about n1, then the least rotation that takes -n3 the rest of the way to l.
        let f = 1.0 / (1.0 - l.z);
        return [
            Vec3::new(1.0 - f * l.x * l.x, -f * l.x * l.y, l.x),
            Vec3::new(f * l.x * l.y, f * l.y * l.y - 1.0, -l.y),
        ];
    }
    let f = 1.0 / sum;
    [
        Vec3::new(1.0 - f * l.x * l.x, -f * l.x * l.y, -l.x),
        Vec3::new(-f * l.x * l.y, 1.0 - f * l.y * l.y, -l.y),
    ]
}
