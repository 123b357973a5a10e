//! A legal Hbot: a sphere and 2 to 8 steered, driven wheels (physics notes, section 1).
//!
//! Parse, don't validate: a [`Device`] that exists has been checked over all steering angles. Its wheels hold the
//! constants from which a posture is computed with one sine and cosine a wheel.
//!
//! ```
//! use hbot_core::kinematics::Posture;
//! use hbot_core::{Device, Vec3, WheelSpec};
//!
//! // Two wheels of 15.5 mm below a sphere of 102 mm and 467 g, their axes 45 degrees off the vertical.
//! let wheel = |side| WheelSpec { axis: Vec3::new(side, 0.0, -1.0), cone: 0.1745, radius: 0.0155, ..WheelSpec::default() };
//! let device = Device::new(0.102, 0.467, &[wheel(1.0), wheel(-1.0)])?;
//! assert_eq!(device.joints(), 4);
//!
//! // Joint rates of a sphere that turns about n3 with 1 rad/s, and back to the sphere, without slip.
//! let posture = Posture::new(&device, &[0.3, -0.2]);
//! let rates = posture.inverse(Vec3::Z);
//! let forward = posture.forward(&device, &rates);
//! assert!((forward.omega - Vec3::Z).length() < 1e-12);
//!
//! // With equal cones about one axis the contact points can meet: no steering angle helps then.
//! let error = Device::new(0.102, 0.467, &[wheel(1.0), wheel(1.0)]).unwrap_err();
//! assert!(error.to_string().starts_with("wheels 1 and 2: their contact points can meet at one point"));
//! # Ok::<(), hbot_core::device::DeviceError>(())
//! ```

use core::fmt;

use crate::real::{Real, Vec3, sincos};
use crate::singularity::{self, Meeting};

/// The most wheels a device can have.
pub const MAX_WHEELS: usize = 8;
/// The most joints a device can have: steer and drive of each wheel, in that order.
pub const MAX_JOINTS: usize = 2 * MAX_WHEELS;
/// The least |sin a cos b| of a wheel that counts as regular; det H is r R times it.
pub const MIN_BOUNDARY: Real = 1.0e-6;

/// One wheel as a designer states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelSpec {
    /// Steering axis through the sphere's centre, in N; any length but zero.
    pub axis: Vec3,
    /// Cone angle a between the steering axis and the contact point, rad, strictly between 0 and pi.
    pub cone: Real,
    /// Toe angle b about the contact normal, rad, strictly between -pi/2 and pi/2.
    pub toe: Real,
    /// Wheel radius r, m.
    pub radius: Real,
    /// Inertia about the steering axis with everything that turns with it, J_th, kg m².
    pub steer_inertia: Real,
    /// Inertia about the axle with the rotor seen through its gear, J_ph, kg m².
    pub drive_inertia: Real,
    /// The wheel's own inertia about its axle, which couples the two joints when the toe is not zero:
    /// J_c = I_axial sin a sin b, kg m². Usually left at 0.
    pub axial_inertia: Real,
}

impl Default for WheelSpec {
    /// A wheel of 10 mm straight below the sphere, a sixth of a right angle off its steering axis, without inertia: a
    /// start from which to state another.
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

/// A legal wheel and its constants.
///
/// The contact frame is C(th) = `p` cos th + `q` sin th + `s`, column by column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wheel {
    spec: WheelSpec,
    pub(crate) p: [Vec3; 3],
    pub(crate) q: [Vec3; 3],
    pub(crate) s: [Vec3; 3],
    /// l.c1 = sin a sin b
    pub(crate) axis_c1: Real,
    /// l.c2 = sin a cos b
    pub(crate) axis_c2: Real,
}

/// A legal device. Lengths m, masses kg, axes in N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Device {
    sphere_radius: Real,
    sphere_mass: Real,
    count: usize,
    wheels: [Wheel; MAX_WHEELS],
}

/// Why a design is not a legal device. Wheels are counted from 0 here and named by their position in messages to people.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DeviceError {
    /// Fewer than 2 or more than [`MAX_WHEELS`] wheels.
    WheelCount(usize),
    /// The sphere's radius is not a positive number.
    SphereRadius(Real),
    /// The sphere's mass is not a positive number.
    SphereMass(Real),
    /// A steering axis is zero or not finite.
    Axis {
        /// Which wheel.
        wheel: usize,
    },
    /// A cone angle is zero, a half turn or more, negative, or not a number.
    Cone {
        /// Which wheel.
        wheel: usize,
        /// What was given, rad.
        value: Real,
    },
    /// A toe angle is a quarter turn or more, or not a number.
    Toe {
        /// Which wheel.
        wheel: usize,
        /// What was given, rad.
        value: Real,
    },
    /// A wheel radius is not a positive number.
    WheelRadius {
        /// Which wheel.
        wheel: usize,
        /// What was given, m.
        value: Real,
    },
    /// An inertia is negative or not a number.
    Inertia {
        /// Which wheel.
        wheel: usize,
        /// What was given, kg m².
        value: Real,
    },
    /// Steering and driving move the contact the same way (boundary singularity): |sin a cos b| is below [`MIN_BOUNDARY`].
    BoundarySingular {
        /// Which wheel.
        wheel: usize,
        /// sin a cos b.
        margin: Real,
    },
    /// The contact points of all wheels can come to lie on one line through the centre (interior singularity).
    InteriorSingular {
        /// Two of the wheels that meet.
        wheels: [usize; 2],
        /// At one point or at opposite ones.
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
    /// A device of a sphere (radius m, mass kg) and 2 to 8 wheels, checked over all steering angles.
    ///
    /// # Errors
    /// The first reason, in the order of [`DeviceError`], why the design is not legal.
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

    /// The sphere's radius R, m.
    #[inline]
    #[must_use]
    pub fn sphere_radius(&self) -> Real {
        self.sphere_radius
    }

    /// The sphere's mass m, kg.
    #[must_use]
    pub fn sphere_mass(&self) -> Real {
        self.sphere_mass
    }

    /// The inertia of the hollow sphere about any axis, 2/3 m R², kg m².
    #[must_use]
    pub fn sphere_inertia(&self) -> Real {
        2.0 / 3.0 * self.sphere_mass * self.sphere_radius * self.sphere_radius
    }

    /// The wheels, 2 to 8.
    #[inline]
    #[must_use]
    pub fn wheels(&self) -> &[Wheel] {
        &self.wheels[..self.count]
    }

    /// How many joints: two a wheel, steer then drive.
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
        // Columns of Rx(a) Rz(b); turning them by th about z and then by A0 gives C.
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

    /// The wheel as stated, its axis scaled to unit length.
    #[inline]
    #[must_use]
    pub fn spec(&self) -> &WheelSpec {
        &self.spec
    }

    /// l.c1 = sin a sin b, the steering axis along the axle, whatever the steering angle.
    #[inline]
    #[must_use]
    pub fn axis_along_axle(&self) -> Real {
        self.axis_c1
    }

    /// l.c2 = sin a cos b, the steering axis along the rolling direction; det H = r R times it.
    #[inline]
    #[must_use]
    pub fn axis_along_roll(&self) -> Real {
        self.axis_c2
    }
}

fn positive(x: Real) -> bool {
    x > 0.0 && x.is_finite()
}

/// 1 + l3 up to which an axis counts as straight down: there it rounds to nothing in 64 bits. The same in 32 bits, so
/// that both widths mean the same by a steering angle of zero.
const STRAIGHT_DOWN: Real = 1.0e-15;

/// The first two columns of A0, the least rotation taking n3 to `l`; the third is `l` itself.
fn least_rotation(l: Vec3) -> [Vec3; 2] {
    // 1 + l3 without cancellation where l points down.
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
