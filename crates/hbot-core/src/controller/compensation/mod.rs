//! Feeds forward what is known of the rig's imperfections: friction, cogging, the weight of an
//! unbalanced sphere, and the torque constants of the motors (physics notes, section 8).
//!
//! It is the last stage of a tick. It adds joint torques to those that render the scene, as far as
//! the limits of motors, contacts, torque and slew leave room, and divides each by the torque
//! constant. A rig that knows of no imperfections has no such stage.
//!
//! - The torque on the sphere that a client sees ([`State::torque`](crate::outputs::State::torque))
//!   stays the torque of the scene, which the hand is to feel. The joint torques and the energy
//!   that the passivity observer counts contain what is fed forward.
//! - Energy that is fed forward to friction does not count as energy that delay creates
//!   ([`Ledger`](crate::safety::passivity::Ledger)), because the friction takes it. If the friction
//!   is less than was measured, it could drive the sphere. [`loan`] prevents that.
//! - The inertia of the wheels is not fed forward. Its torque follows from accelerations, which are
//!   not measured: the difference of two rates is a tick late, and the counts of the prototype give
//!   it a noise of 17 mN m. The part that follows from rates alone, Gᵀ J (dG/dt) w, would give the
//!   sphere energy.

mod cogging;
mod friction;
mod loan;
mod rising;

use self::loan::Loan;
pub(super) use self::rising::Rising;
use super::Controller;
use super::torque::part_within;
use crate::allocation;
use crate::count::Count;
use crate::design::device::MAX_JOINTS;
use crate::design::kinematics::torque_of;
use crate::design::rig::{Compensation, Friction, Rig};
use crate::outputs::Outputs;
use crate::real::{Quat, Real, Vec3, fabs, sqrt};

/// Fraction of the measured dry friction of a joint below which the torque of a scene cannot move
/// the joint from rest. The true friction is at least half of what was measured, or the measurement
/// is useless.
const HOLDS: Real = 0.5;
/// Rate of a joint that counts as rest, as a fraction of the smoothing. A ninth of the friction is
/// fed forward at this rate.
const STILL: Real = 0.5;

/// The stage that feeds forward, with its memory.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "exact", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Compensator {
    known: Compensation,
    /// Time from a reading to the middle of the time for which its torque acts, s.
    delay: Real,
    /// Torques that are fed forward in this tick, N m at the joints.
    joints: [Real; MAX_JOINTS],
    /// The torque that they make on the sphere, N m.
    torque: Vec3,
    /// The whole torque on the sphere of the last tick, N m.
    total: Vec3,
    /// Energy that has been fed forward since the start, J. It is computed with the last torque, so
    /// it errs by what changes within the delay of the loop.
    given: Real,
    loan: Loan,
}

impl Compensator {
    /// Returns the stage for `rig`, or `None` if nothing is known of its imperfections.
    pub(super) fn new(rig: &Rig) -> Option<Self> {
        let known = rig.compensation.filter(Compensation::is_some)?;
        Some(Self {
            known,
            delay: 1.5 * rig.timing.period_s() + rig.torque_lag,
            joints: [0.0; MAX_JOINTS],
            torque: Vec3::ZERO,
            total: Vec3::ZERO,
            given: 0.0,
            loan: Loan::START,
        })
    }

    /// Returns how the fed friction of `rig` rises.
    pub(super) fn rising(rig: &Rig) -> Option<Rising> {
        let known = rig.compensation.filter(Compensation::is_some)?;
        Some(Rising::new(known.joints.map(|joint| joint.gear_loss)))
    }

    /// Returns the energy that has been fed forward since the start, J.
    pub(super) fn given(&self) -> Real {
        self.given
    }

    /// Returns the torque of the sphere's weight at the orientation `q`, in frame N, in N m.
    fn weight(&self, q: Quat) -> Vec3 {
        (q * self.known.imbalance).cross(Vec3::NEG_Z)
    }
}

impl Controller {
    /// Adds what is fed forward in tick `tick` to `outputs`. `dt` is the time since the last tick,
    /// s. It is a separate function, so that it costs nothing if nothing is known.
    #[inline(never)]
    pub(super) fn compensate<C: Count>(&mut self, count: C, tick: u64, dt: Real, outputs: &mut Outputs) {
        let gain = if self.powered() { self.machine.gain * self.shaking.gain() } else { 0.0 };
        let n = count.joints();
        let wanted = self.fed_forward(count, dt, gain);
        let (joints, torque) = self.within_limits(count, dt, gain, &wanted);
        let Some(stage) = &mut self.compensation else { return };
        stage.given += stage.torque.dot(self.joints.omega) * dt;
        (stage.joints, stage.torque) = (joints, torque);
        stage.total = self.made.torque + torque;
        let mut commands = [0.0; MAX_JOINTS];
        for j in 0..n {
            let sum = self.made.joints[j] + joints[j];
            commands[j] = sum / stage.known.joints[j].torque_scale;
            outputs.drive.torque[j] = self.joints.in_controller_sense(j, commands[j]);
            outputs.state.joint_torque[j] = sum;
        }
        if let Some(grip) = self.rig.limits.traction {
            let held = grip.mu * grip.normal_force;
            let sums = &outputs.state.joint_torque[..n];
            outputs.state.traction = allocation::traction(&self.arms[..n / 2], sums, held).min(1.0);
        }
        // The observer and the sums of heat take the whole torque in place of the scene's.
        self.observer.record(tick as u32, stage.total);
        if let Some(heat) = &mut self.heat {
            heat.hold(&commands);
        }
        if let Some(ledger) = &mut self.ledger {
            ledger.drive(tick as u32, torque);
        }
    }

    /// Returns the joint torques that make up for the imperfections, N m, before any limit.
    fn fed_forward<C: Count>(&mut self, count: C, dt: Real, gain: Real) -> [Real; MAX_JOINTS] {
        let mut wanted = [0.0; MAX_JOINTS];
        let n = count.joints();
        let Some(stage) = &mut self.compensation else { return wanted };
        let known = &stage.known;
        let omega = self.joints.omega;
        let mut now = loan::Moment {
            dt,
            omega,
            kinetic: 0.5 * self.rig.device.sphere_inertia() * omega.length_squared(),
            given: self.observer.energy(),
            lost: known.sphere.loss(omega.dot(omega)) * dt,
            quiet: true,
            still: true,
        };
        for j in 0..n {
            let (friction, rate) = (&known.joints[j].friction, self.joints.rate[j]);
            let spec = self.rig.device.wheels()[j / 2].spec();
            let inertia = if j % 2 == 0 { spec.steer_inertia } else { spec.drive_inertia };
            now.kinetic += 0.5 * inertia * rate * rate;
            now.lost += friction.loss(rate * rate) * dt;
            if let Some(rising) = &self.rising {
                now.lost += rising.loss[j] * fabs(self.made.joints[j] * rate) * dt;
            }
            now.quiet &= fabs(self.made.joints[j]) <= HOLDS * friction.coulomb;
            now.still &= fabs(rate) <= STILL * known.smoothing;
        }
        stage.loan.advance(&now, gain > 0.0);
        if gain == 0.0 {
            if let Some(rising) = &mut self.rising {
                rising.rest();
            }
            return wanted;
        }
        let friction = known.part * stage.loan.gain() * gain;
        let mut on_sphere = stage.weight(self.orientation.q) * -gain;
        if known.sphere.is_some() {
            on_sphere += match &mut self.rising {
                None => known.sphere.along(omega, known.smoothing),
                Some(rising) => {
                    let speed = sqrt(omega.length_squared());
                    let part = Friction::part(speed, known.smoothing) / speed.max(Real::MIN_POSITIVE);
                    rising.sphere(omega * part, dt) * known.sphere.coulomb + omega * known.sphere.viscous
                }
            } * friction;
        }
        if on_sphere != Vec3::ZERO {
            let rows = self.joints.posture.first_rows(count);
            wanted = allocation::allocate_in_tick(count, rows, &self.limits, &self.gives, on_sphere).torque;
        }
        for j in 0..n {
            if self.limits.peak[j] == 0.0 {
                continue;
            }
            let (imperfect, rate) = (&known.joints[j], self.joints.rate[j]);
            wanted[j] += match &mut self.rising {
                None => imperfect.friction.against(rate, known.smoothing),
                Some(rising) => {
                    let steady = Friction::part(rate, known.smoothing);
                    let dry = imperfect.friction.coulomb * rising.joint(j, steady, dt);
                    // A gear loses in proportion to the torque that it passes on. That is too much
                    // to be held while the joint rests.
                    let lost = rising.loss[j] * fabs(self.made.joints[j]) * steady;
                    dry + lost + imperfect.friction.viscous * rate
                }
            } * friction;
            let gear = self.rig.joints[j].gear;
            for harmonic in &imperfect.cogging {
                if harmonic.amplitude != 0.0 {
                    let shaft = (self.joints.angle[j] * gear, rate * gear);
                    let times = (self.rig.timing.period_s(), stage.delay);
                    wanted[j] -= harmonic.torque(shaft, times) * gain;
                }
            }
        }
        wanted
    }

    /// Returns as much of the joint torques `wanted` as the limits leave beside the torques of the
    /// scene, and the torque that it makes on the sphere, N m. The torque on the sphere changes by
    /// at most the slew limit, and neither it nor a joint torque nor a contact exceeds its limit.
    fn within_limits<C: Count>(
        &self,
        count: C,
        dt: Real,
        gain: Real,
        wanted: &[Real; MAX_JOINTS],
    ) -> ([Real; MAX_JOINTS], Vec3) {
        let Some(stage) = &self.compensation else { return ([0.0; MAX_JOINTS], Vec3::ZERO) };
        if gain == 0.0 {
            return ([0.0; MAX_JOINTS], Vec3::ZERO);
        }
        let (n, rows) = (count.joints(), self.joints.posture.first_rows(count));
        let (made, limits) = (&self.made, &self.rig.limits);
        let mut joints = stage.joints;
        let held = torque_of(rows, &joints[..n]);
        let way = torque_of(rows, &wanted[..n]) - held;
        let part = part_within(made.torque + held - stage.total, way, limits.torque_rate * dt);
        for j in 0..n {
            joints[j] += (wanted[j] - joints[j]) * part;
        }
        // All limits are convex, and the torques of the scene alone are within them.
        let torque = torque_of(rows, &joints[..n]);
        let mut share = part_within(made.torque, torque, limits.torque);
        for j in 0..n {
            let room = self.limits.peak[j] - fabs(made.joints[j]);
            let more = if made.joints[j] < 0.0 { -joints[j] } else { joints[j] };
            let room = if more < 0.0 { room + 2.0 * fabs(made.joints[j]) } else { room };
            if fabs(more) > room {
                share = share.min((room / fabs(more)).max(0.0));
            }
        }
        if let Some(grip) = limits.traction {
            let force = |wheel: usize, torques: &[Real; MAX_JOINTS]| {
                let [x, y] = self.arms[wheel].force(torques[2 * wheel], torques[2 * wheel + 1]);
                Vec3::new(x, y, 0.0)
            };
            for wheel in 0..count.wheels() {
                let (from, way) = (force(wheel, &made.joints), force(wheel, &joints));
                share = share.min(part_within(from, way, grip.mu * grip.normal_force));
            }
        }
        for torque in &mut joints[..n] {
            *torque *= share;
        }
        (joints, torque * share)
    }
}

#[cfg(test)]
mod tests;
