//! A guide holds some directions of turning and leaves others free.
//!
//! It is smooth everywhere, because it follows the quaternion law with a stiffness that acts in
//! some directions only. With x = (eta, e) and the unit axis a:
//!
//! - Free about the axis: V = 2 K |e - (e.a) a|² = K (1 - cos swing), T = -2 Eᵀ K (I - a aᵀ) e.
//! - Free except for the twist: V = 2 K (e.a)², T = -2 Eᵀ K a aᵀ e.
//! - Free in the plane with the normal a, in which the sphere's axis u stays: V = 1/2 K s², s = d.a
//!   with d = R(x) u, T = -K s (d x a).
//!
//! A dead band shortens the quantity that is squared, so each law remains a gradient.

use super::target::{Target, beyond, beyond_gradient, places_of_spring};
use super::{Anchor, Law, Now};
use crate::real::{Quat, Real, Vec3, asin, fabs, sincos};
use crate::render::around::Spot;
use crate::render::impedance::quaternion_pull;
use crate::render::outline::Outline;
use crate::rotation::vector_part;

/// The turns of the sphere that a guide leaves free. All others are held by a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub enum Freedom {
    /// The sphere turns freely about the guide's axis, as on a hinge. All other turns are held.
    Axis,
    /// The sphere turns freely except about the guide's axis.
    Swing,
    /// The sphere turns freely as long as this unit axis, fixed in the sphere, stays in a plane.
    /// The guide's axis is the normal of the plane.
    Plane(Vec3),
}

/// An effect that lets the sphere turn freely in some directions and holds it with a spring in the
/// others.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct Guide {
    /// Orientation from which turns are measured.
    pub target: Target,
    /// Axis of the guide, a unit vector in the target's frame.
    pub axis: Vec3,
    /// The turns of the sphere that are free. A spring holds the sphere in all other directions.
    pub free: Freedom,
    /// Stiffness of the spring against turns that are not free, N m/rad.
    pub stiffness: Real,
    /// Viscous damping of turns that are not free, N m s/rad.
    pub damping: Real,
    /// Dead band, rad: the spring makes no torque until the sphere has turned by this angle in a
    /// direction that is not free.
    pub deadband: Real,
}

impl Guide {
    /// Returns the component of the vector `v` in the directions that the guide holds.
    #[inline]
    fn held(&self, v: Vec3) -> Vec3 {
        let along = self.axis * self.axis.dot(v);
        match self.free {
            Freedom::Axis => v - along,
            Freedom::Swing | Freedom::Plane(_) => along,
        }
    }

    /// Returns two values for the rotation `x`. The first is the sine of the angle between the
    /// sphere's axis `u` and the plane of the guide, less the dead band. The second is the gradient
    /// of this sine.
    #[inline]
    fn rise(&self, x: Quat, u: Vec3) -> (Real, Vec3) {
        let d = x * u;
        let s = d.dot(self.axis);
        let dead = sincos(self.deadband).0;
        let s = if fabs(s) > dead { s - dead * s.signum() } else { 0.0 };
        (s, d.cross(self.axis))
    }

    /// Returns the length of the quaternion's vector part e for a turn by the dead band:
    /// sin(deadband / 2).
    fn dead_sine(&self) -> Real {
        sincos(0.5 * self.deadband).0
    }
}

impl Law for Guide {
    type Memory = ();

    #[inline]
    fn render(&self, now: &mut Now<'_>, (): &mut ()) -> Vec3 {
        let x = now.relative();
        if let Freedom::Plane(u) = self.free {
            let (s, gradient) = self.rise(x, u);
            let mut push = self.stiffness * s;
            if self.damping > 0.0 {
                push += self.damping * gradient.dot(now.rate());
            }
            return now.in_n(gradient * -push);
        }
        let e = vector_part(x);
        let mut f = self.held(e) * self.stiffness;
        if self.deadband > 0.0 {
            let (held, dead) = (self.held(e), self.dead_sine());
            // The projection is its own transpose.
            f = self.held(beyond_gradient(held, dead, beyond(held, dead) * self.stiffness));
        }
        let mut torque = quaternion_pull(x.w, e, f);
        if self.damping > 0.0 {
            torque -= self.held(now.rate()) * self.damping;
        }
        now.in_n(torque)
    }

    fn energy(&self, now: &mut Now<'_>, (): &()) -> Option<Real> {
        let x = now.relative();
        Some(match self.free {
            Freedom::Plane(u) => {
                let (s, _) = self.rise(x, u);
                0.5 * self.stiffness * s * s
            }
            _ => 2.0 * self.stiffness * beyond(self.held(vector_part(x)), self.dead_sine()).length_squared(),
        })
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }

    fn excess(&self, desired: Quat, q: Quat, _: &[Real]) -> Option<Real> {
        let x = desired.conjugate() * q;
        Some(match self.free {
            Freedom::Plane(u) => {
                (fabs(asin((x * u).dot(self.axis).clamp(-1.0, 1.0))) - self.deadband).max(0.0)
            }
            // The angle of the turn about the held directions that has this part of e.
            _ => (2.0 * asin(self.held(vector_part(x)).length().min(1.0)) - self.deadband).max(0.0),
        })
    }

    fn places(&self, _: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, ())) {
        let (first, second) = self.axis.any_orthonormal_pair();
        match self.free {
            Freedom::Axis => places_of_spring(&[first, second], self.deadband, visit),
            Freedom::Swing => places_of_spring(&[self.axis], self.deadband, visit),
            Freedom::Plane(u) => {
                // The shortest turn of `u` into the plane, and the axis of a turn out of it.
                let inside = (u - self.axis * u.dot(self.axis)).try_normalize().unwrap_or(first);
                let x = Quat::from_rotation_arc(u, inside);
                places_of_spring(&[inside.cross(self.axis)], self.deadband, &mut |spot, turn, deeper, ()| {
                    visit(spot, turn * x, deeper, ());
                });
            }
        }
    }

    fn outline<'a>(&self, _: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        let axis = self.axis;
        visit(match self.free {
            Freedom::Axis => Outline::Hinge { axis },
            Freedom::Swing => Outline::Untwisted { axis },
            Freedom::Plane(pointer) => Outline::Plane { normal: axis, pointer },
        });
    }
}
