//! Exact simulation of one axis that acts against a sampled wall.

/// A model of one axis that moves against a virtual wall: the mechanics, the control loop, and the
/// spring and damper that the loop renders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wall {
    /// Inertia J of the axis, kg m².
    pub(crate) inertia: f64,
    /// Viscous damping b of the mechanics, N m s/rad.
    pub(crate) own: f64,
    /// Coulomb friction c of the mechanics, N m.
    pub(crate) coulomb: f64,
    /// Step d of the measured angle, rad. If it is 0, the angle is measured exactly.
    pub(crate) step: f64,
    /// Period h of the control loop, s.
    pub(crate) period: f64,
    /// Delay D from a reading to the torque computed from it, in whole ticks.
    pub(crate) delay: usize,
    /// Stiffness K that the wall renders, N m/rad.
    pub(crate) stiffness: f64,
    /// Damping B that the wall renders, N m s/rad. It acts on the difference of the last two
    /// readings.
    pub(crate) damping: f64,
}

/// Number of past torques that are stored, one per tick. The delay must be shorter than this
/// number.
const LONGEST: usize = 8;

impl Wall {
    /// Creates an axis with the given inertia (kg m²), viscous damping (N m s/rad) and loop period
    /// (s). It has no friction or delay, its angle is measured exactly, and its virtual wall has no
    /// stiffness or damping.
    pub(crate) fn of(inertia: f64, own: f64, period: f64) -> Self {
        Self { inertia, own, coulomb: 0.0, step: 0.0, period, delay: 0, stiffness: 0.0, damping: 0.0 }
    }

    /// Releases the axis at `angle` (rad) and simulates `ticks` ticks. Calls `each` with the angle
    /// at the end of each tick.
    pub(crate) fn released(&self, angle: f64, ticks: usize, mut each: impl FnMut(f64)) {
        let (mut x, mut v) = (angle, 0.0);
        let mut last = self.read(x);
        let mut torques = [0.0; LONGEST];
        for k in 0..ticks {
            let reading = self.read(x);
            let rate = (reading - last) / self.period;
            last = reading;
            torques[k % LONGEST] = -self.stiffness * reading - self.damping * rate;
            let torque = if k < self.delay { 0.0 } else { torques[(k - self.delay) % LONGEST] };
            (x, v) = self.moved(x, v, torque, self.period);
            each(x);
        }
    }

    fn read(&self, x: f64) -> f64 {
        if self.step > 0.0 { (x / self.step).round() * self.step } else { x }
    }

    /// Returns the angle (rad) and the rate (rad/s) after `time` seconds under a constant torque.
    /// Coulomb friction can hold the axis completely at rest.
    fn moved(&self, mut x: f64, mut v: f64, torque: f64, mut time: f64) -> (f64, f64) {
        // A phase ends when the rate reaches zero. In the phase after that the axis sticks, or it
        // moves in the other direction until the end.
        for _ in 0..3 {
            let sense = if v != 0.0 { v.signum() } else { torque.signum() };
            if v == 0.0 && torque.abs() <= self.coulomb {
                return (x, 0.0);
            }
            let force = torque - self.coulomb * sense;
            let stop = self.stops_after(v, force).filter(|stop| *stop < time && self.coulomb > 0.0);
            let Some(stop) = stop else { return self.coasted(x, v, force, time) };
            (x, _) = self.coasted(x, v, force, stop);
            v = 0.0;
            time -= stop;
        }
        (x, v)
    }

    /// Returns the angle (rad) and the rate (rad/s) after `time` seconds, if the axis does not stop
    /// meanwhile. They are the exact solution of J v' = force - b v.
    fn coasted(&self, x: f64, v: f64, force: f64, time: f64) -> (f64, f64) {
        let (acceleration, rate) = (force / self.inertia, self.own / self.inertia);
        let z = rate * time;
        // For small z, (1 - exp(-z))/z and (1 - that)/z are computed by their series, as the
        // formulas suffer from cancellation. The next terms are z^4/120 and z^3/120.
        let (first, second) = if z < 1.0e-3 {
            (1.0 - z * (0.5 - z * (1.0 / 6.0 - z / 24.0)), 0.5 - z * (1.0 / 6.0 - z * (1.0 / 24.0)))
        } else {
            let first = -libm::expm1(-z) / z;
            (first, (1.0 - first) / z)
        };
        let end = v + (acceleration - rate * v) * time * first;
        (x + v * time + (acceleration - rate * v) * time * time * second, end)
    }

    /// Returns the time after which an axis with the rate `v` stops under a constant force, s.
    /// Returns `None` if it never stops.
    fn stops_after(&self, v: f64, force: f64) -> Option<f64> {
        // Only a force against the motion stops it. Damping alone never quite does.
        if v == 0.0 || v * (force - self.own * v) >= 0.0 || v * force >= 0.0 {
            return None;
        }
        let rate = self.own / self.inertia;
        let bare = -v * self.inertia / force;
        Some(if rate * bare < 1.0e-9 { bare } else { libm::log1p(rate * bare) / rate })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Wall = Wall {
        inertia: 2.0,
        own: 0.0,
        coulomb: 0.0,
        step: 0.0,
        period: 0.1,
        delay: 0,
        stiffness: 0.0,
        damping: 0.0,
    };

    #[test]
    fn a_constant_torque_accelerates() {
        let (x, v) = FREE.moved(1.0, 3.0, 4.0, 0.5);
        assert!((v - 4.0).abs() < 1e-14 && (x - 2.75).abs() < 1e-14, "{x} {v}");
        // With damping the motion is an exponential.
        let damped = Wall { own: 3.0, ..FREE };
        let (x, v) = damped.moved(0.0, 2.0, 0.0, 0.5);
        let decay = (-0.75_f64).exp();
        assert!((v - 2.0 * decay).abs() < 1e-14 && (x - 2.0 * (1.0 - decay) / 1.5).abs() < 1e-14, "{x} {v}");
    }

    #[test]
    fn friction_stops_and_holds() {
        let rough = Wall { coulomb: 1.0, ..FREE };
        // The axis stops after v²/(2 a), with a = (1 - 0.5)/2 or (1 + 0.5)/2. A torque below the
        // friction then does not move it.
        let (x, v) = rough.moved(0.0, 1.0, 0.5, 100.0);
        assert!(v == 0.0 && (x - 2.0).abs() < 1e-14, "{x} {v}");
        assert_eq!(rough.moved(0.3, 0.0, -1.0, 1.0), (0.3, 0.0));
        // A torque above the friction turns the axis around. It stops at 1/3 after 2/3 s and goes
        // back with 0.5 rad/s².
        let (x, v) = rough.moved(0.0, 1.0, -2.0, 2.0 / 3.0 + 1.0);
        assert!((v + 0.5).abs() < 1e-12 && (x - (1.0 / 3.0 - 0.25)).abs() < 1e-12, "{x} {v}");
    }
}
