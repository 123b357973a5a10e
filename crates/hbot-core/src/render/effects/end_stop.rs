//! Walls around a cone of directions and a range of twist. They only push, never pull.
//!
//! Let p > 0 be the depth in a wall, beyond the cone or beyond the range of twist. The torque is T
//! = -(K p + D r(p) max(0, dp/dt)) grad p. It is damped only on the way in, so it never pulls. The
//! factor r rises from 0 to 1 over the first 10 mrad, so that nothing jumps at the edge (after Hunt
//! and Crossley, 1975). The wall of the cone fades towards the opposite direction, and the wall of
//! the twist fades with its dial. Both fade by their energy, so without damping they are exact
//! gradients.

use super::geometry::{Dial, SWING_FADE, Swing, Turns};
use super::knock::{Meets, Touched};
use super::target::Target;
use super::{Anchor, Law, Now};
use crate::real::{PI, Quat, Real, Vec3};
use crate::render::around::Spot;
use crate::render::outline::Outline;
use crate::rotation::{exp, shortest};

/// Depth in a wall at which the wall's damping reaches its full value, rad. The damping rises
/// gradually, so that the torque does not jump at the wall's edge.
const SOFT: Real = 0.01;

/// An effect with walls that keep an axis of the sphere within a cone, and its twist about this
/// axis within a range.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub struct EndStop {
    /// Orientation from which the cone and the twist are measured.
    pub target: Target,
    /// Unit axis that is fixed in the sphere and has to stay within the cone. The centre of the
    /// cone is the place of this axis in the target's frame. The twist is the turn about this axis.
    pub axis: Vec3,
    /// Half of the opening angle of the cone, rad, at most 2.7. `None` if there is no cone.
    pub cone: Option<Real>,
    /// Smallest and largest twist, rad; they can cover many turns. `None` if the twist is not
    /// limited.
    pub twist: Option<[Real; 2]>,
    /// Stiffness of the walls, N m/rad.
    pub stiffness: Real,
    /// Viscous damping of the walls while the sphere moves into them, N m s/rad. A wall does not
    /// damp motion out of it, so it never pulls.
    pub damping: Real,
}

impl EndStop {
    /// Returns the slope of the cone wall's energy, N m, if the swing is `depth` rad (above 0)
    /// beyond the cone.
    fn cone_slope(&self, swing: &Swing, depth: Real) -> Real {
        self.stiffness * depth * swing.fade()
    }

    fn cone_energy(&self, angle: Real, cone: Real) -> Real {
        let depth = angle - cone;
        let (room, left) = (PI - cone, PI - angle);
        if !(depth > 0.0) {
            return 0.0;
        }
        if left >= SWING_FADE {
            return 0.5 * self.stiffness * depth * depth;
        }
        // The integral of K p (pi - angle)/fade from the start of the fade.
        let part = |y: Real| y * y * (0.5 * room - y * (1.0 / 3.0));
        let before = room - SWING_FADE;
        self.stiffness * (0.5 * before * before + (part(SWING_FADE) - part(left)) * (1.0 / SWING_FADE))
    }

    /// Returns how far the twist `psi` is beyond its range, rad: positive above the upper end,
    /// negative below the lower end, and 0 within the range.
    fn twist_depth(psi: Real, [low, high]: [Real; 2]) -> Real {
        (psi - high).max(0.0) + (psi - low).min(0.0)
    }

    fn damping_at(&self, depth: Real) -> Real {
        self.damping * (depth * (1.0 / SOFT)).min(1.0)
    }
}

/// Distance from a wall at which a sphere that touched it has left it, rad.
const LEFT: Real = 2.0e-3;

impl Meets for EndStop {
    fn touched(&self, now: &mut Now<'_>, turns: &Turns, held: [u16; 2]) -> [Option<Touched>; 2] {
        let edge = |held: bool| if held { -LEFT } else { 0.0 };
        let cone = self.cone.and_then(|cone| {
            let swing = Swing::new(now.relative(), self.axis);
            let touches = swing.angle - cone > edge(held[0] == 1);
            touches.then_some(Touched { place: 1, way: swing.gradient })
        });
        let twist = self.twist.and_then(|[low, high]| {
            let dial = now.dial(self.axis);
            let psi = turns.unwrap(dial.psi);
            // Only the nearer wall can be touched: the other is a range of twist away.
            if psi - high > edge(held[1] == 2) {
                Some(Touched { place: 2, way: dial.gradient })
            } else if low - psi > edge(held[1] == 1) {
                Some(Touched { place: 1, way: -dial.gradient })
            } else {
                None
            }
        });
        [cone, twist]
    }
}

impl Law for EndStop {
    type Memory = Turns;

    #[inline]
    fn render(&self, now: &mut Now<'_>, turns: &mut Turns) -> Vec3 {
        let mut torque = Vec3::ZERO;
        if let Some(cone) = self.cone {
            let swing = Swing::new(now.relative(), self.axis);
            let depth = swing.angle - cone;
            if depth > 0.0 {
                let inwards = swing.gradient.dot(now.rate()).max(0.0);
                let damping = self.damping_at(depth) * swing.fade();
                torque -= swing.gradient * (self.cone_slope(&swing, depth) + damping * inwards);
            }
        }
        if let Some(range) = self.twist {
            let dial = now.dial(self.axis);
            let depth = Self::twist_depth(turns.follow(dial.psi), range);
            if depth != 0.0 {
                torque += dial.torque(0.5 * self.stiffness * depth * depth, self.stiffness * depth);
                let rate = now.rate();
                if dial.gradient.dot(rate) * depth > 0.0 {
                    torque += dial.resist(rate, self.damping_at(depth.abs()));
                }
            }
        }
        now.in_n(torque)
    }

    fn energy(&self, now: &mut Now<'_>, turns: &Turns) -> Option<Real> {
        let mut energy = 0.0;
        if let Some(cone) = self.cone {
            energy += self.cone_energy(Swing::new(now.relative(), self.axis).angle, cone);
        }
        if let Some(range) = self.twist {
            let dial = now.dial(self.axis);
            let depth = Self::twist_depth(turns.unwrap(dial.psi), range);
            energy += 0.5 * self.stiffness * depth * depth * dial.fade().0;
        }
        Some(energy)
    }

    fn reference(&self) -> Option<(Quat, Anchor)> {
        Some(self.target.reference())
    }

    fn excess(&self, desired: Quat, q: Quat, _: &[Real]) -> Option<Real> {
        let x = shortest(desired.conjugate() * q);
        let cone = self.cone.map_or(0.0, |cone| Swing::new(x, self.axis).angle - cone);
        let twist =
            self.twist.map_or(0.0, |range| Self::twist_depth(Dial::new(x, self.axis).psi, range).abs());
        Some(cone.max(twist).max(0.0))
    }

    fn places(&self, _: &[Real], visit: &mut dyn FnMut(Spot, Quat, Vec3, Turns)) {
        if let Some(cone) = self.cone {
            let (first, second) = self.axis.any_orthonormal_pair();
            for away in [first, second] {
                visit(Spot::Wall, exp(away * cone), away, Turns::default());
            }
        }
        for (side, end) in [-1.0, 1.0].into_iter().zip(self.twist.into_iter().flatten()) {
            visit(Spot::Wall, exp(self.axis * end), self.axis * side, Turns::at(end));
        }
    }

    fn outline<'a>(&self, _: &'a [Real], visit: &mut dyn FnMut(Outline<'a>)) {
        let axis = self.axis;
        if let Some(angle) = self.cone {
            visit(Outline::Cone { axis, angle });
        }
        if let Some(range) = self.twist {
            visit(Outline::Twist { axis, range });
        }
    }
}
