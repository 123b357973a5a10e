//! Executes live commands.

use super::Controller;
use crate::inputs::{Command, Inputs, MAX_COMMANDS, ModelCommand, OnClientLost, Stamp};
use crate::motion::reference::{Fused, Uncertainty};
use crate::outputs::{Refusal, Reply};
use crate::real::{PI, Quat, Real, Vec3, fabs, sqrt};
use crate::render::model::LocalModel;
use crate::render::scene::CompiledScene;
use crate::rotation;
use crate::safety::mode::Mode;

impl Controller {
    /// Executes the commands of a tick and returns the reply to each. It is a separate function,
    /// because most ticks have no commands.
    #[inline(never)]
    pub(super) fn obey_all(
        &mut self,
        scene: &CompiledScene,
        inputs: &Inputs,
    ) -> [Option<Reply>; MAX_COMMANDS] {
        let mut replies = [None; MAX_COMMANDS];
        for (index, command) in inputs.commands.iter().enumerate() {
            replies[index] = Some(match command {
                Command::Model(command) => {
                    self.take_model(inputs.tick, *command, inputs.commands.model(index))
                }
                command => self.obey(scene, inputs.tick, command),
            });
        }
        // A stop overrides all other commands of its tick, also later ones.
        if inputs.commands.iter().any(|command| matches!(command, Command::Estop)) {
            self.machine.estop();
        }
        replies
    }

    /// Executes a client's command and returns the reply. A refused command changes nothing; the
    /// reply then contains the reason.
    fn obey(&mut self, scene: &CompiledScene, tick: u64, command: &Command) -> Reply {
        match *command {
            Command::Enable => self.enable(scene),
            Command::Disable => {
                self.machine.disable();
                Reply::Done
            }
            Command::Estop => {
                self.machine.estop();
                Reply::Done
            }
            Command::Reset => match self.machine.reset(self.homed) {
                Ok(()) => Reply::Done,
                Err(obstacle) => Reply::Refused(Refusal::Mode(obstacle)),
            },
            Command::Stream { torque, valid_ticks, stamp } => {
                if !torque.is_finite() {
                    return Reply::Refused(Refusal::NotFinite);
                }
                self.take_stamped(tick, stamp, |this| {
                    this.stream.set(torque, tick.saturating_add(u64::from(valid_ticks.max(1)) - 1));
                    Ok(())
                })
            }
            Command::Reference { slot, epoch, q, omega, valid_ticks, stamp } => {
                let Some(goal) = rotation::from_wxyz(rotation::to_wxyz(q)).filter(|_| is_unit(q)) else {
                    return Reply::Refused(Refusal::NotFinite);
                };
                if !omega.is_finite() {
                    return Reply::Refused(Refusal::NotFinite);
                }
                let until = tick.saturating_add(u64::from(valid_ticks));
                self.take_stamped(tick, stamp, |this| {
                    let there = this.renderer.set_reference(scene, (slot, epoch), goal, omega, until);
                    if there { Ok(()) } else { Err(Refusal::NoReference) }
                })
            }
            Command::Align { q, weight, tick: seen } => self.align(q, weight, seen),
            Command::AlignBySigma { q, sigma, weight, tick: seen } => {
                self.align_by_sigma(q, sigma, weight, seen)
            }
            Command::AlignDirection { body, world, sigma, tick: seen } => {
                self.align_direction(body, world, sigma, seen)
            }
            // It has no meaning without its model.
            Command::Model(_) | Command::Confirm => Reply::Done,
            Command::ClientLost(policy) => {
                match policy {
                    OnClientLost::Ramp => self.end_streams(tick),
                    OnClientLost::Keep => {}
                    // The event becomes a fault condition in the next tick, like all others.
                    OnClientLost::Fault => {
                        self.end_streams(tick);
                        self.client_lost = true;
                    }
                }
                Reply::Done
            }
        }
    }

    fn enable(&mut self, scene: &CompiledScene) -> Reply {
        if let Some(obstacle) = self.machine.obstacle() {
            return Reply::Refused(Refusal::Mode(obstacle));
        }
        if self.machine.mode == Mode::Idle {
            let q = self.orientation.q;
            if let Some((slot, angle)) = self.renderer.too_far(scene, q, self.rig.limits.enable_max_angle) {
                return Reply::Refused(Refusal::TooFar { slot, angle });
            }
            self.renderer.enable(scene, q);
            // If the torque is still ramping down after a disable, it blends into the new one.
            self.anchored = true;
            self.shaking.restart();
            if let Some(guard) = &mut self.guard {
                guard.restart();
            }
            self.machine.enable();
        }
        Reply::Done
    }

    /// Calls `take` to accept a torque, reference or model that a client streams. Refuses the
    /// message if the state from which the client computed it is too old or lies in a future tick.
    /// A message that names a future tick would count as fresh until that tick.
    fn take_stamped(
        &mut self,
        tick: u64,
        stamp: Stamp,
        take: impl FnOnce(&mut Self) -> Result<(), Refusal>,
    ) -> Reply {
        if let Some(ticks) = stamp.tick.and_then(|seen| seen.checked_sub(tick)).filter(|ahead| *ahead > 0) {
            return Reply::Refused(Refusal::Ahead { ticks });
        }
        let age_ticks = stamp.tick.map_or(0, |seen| tick.saturating_sub(seen));
        if age_ticks > u64::from(self.rig.limits.max_age_ticks) {
            return Reply::Refused(Refusal::TooOld { age_ticks });
        }
        if let Err(refusal) = take(self) {
            return Reply::Refused(refusal);
        }
        self.client = Some((stamp, tick));
        Reply::Done
    }

    /// Takes a model that a client streams. `model` is `None` if a later one of the same tick has
    /// replaced it.
    fn take_model(&mut self, tick: u64, command: ModelCommand, model: Option<&LocalModel>) -> Reply {
        let ModelCommand { valid_ticks, blend_ticks, stamp } = command;
        if !model.is_none_or(LocalModel::is_legal) {
            return Reply::Refused(Refusal::NotFinite);
        }
        let named = match stamp.tick {
            // A tick of the future is refused below.
            Some(seen) if seen <= tick => self.orientation.at(seen),
            _ => Some(self.orientation.q),
        };
        let given = model.is_none_or(|model| model.pose.is_some());
        self.take_stamped(tick, stamp, |this| {
            if named.is_none() && !given {
                return Err(Refusal::NotInHistory);
            }
            if let Some(model) = model {
                let model = model.at_pose(named);
                let until = tick.saturating_add(u64::from(valid_ticks.max(1)) - 1);
                let (period, limit) = (this.rig.timing.period_s(), this.rig.limits.torque);
                let blend_s = blend_ticks.map(|ticks| ticks as Real * period);
                this.model.set(model, (tick, until), blend_s, period, this.rendered_motion, limit);
            }
            Ok(())
        })
    }

    /// Ends what a client streams at `tick`.
    fn end_streams(&mut self, tick: u64) {
        self.stream.end(tick);
        self.model.end(tick);
    }

    fn align(&mut self, q: Quat, weight: Real, seen: u64) -> Reply {
        if !(is_unit(q) && (0.0..=1.0).contains(&weight)) {
            return Reply::Refused(Refusal::NotFinite);
        }
        let Some(then) = self.orientation.at(seen) else {
            return Reply::Refused(Refusal::NotInHistory);
        };
        let delta = rotation::difference(q, then);
        if weight > 0.0 {
            self.orientation.correct(then, delta, weight);
        }
        Reply::Aligned { angle: delta.length() }
    }

    fn align_by_sigma(&mut self, q: Quat, sigma: Vec3, weight: Real, seen: u64) -> Reply {
        let legal = sigma.to_array().iter().all(|x| SIGMA.contains(x));
        if !(is_unit(q) && legal && (0.0..=1.0).contains(&weight)) {
            return Reply::Refused(Refusal::NotFinite);
        }
        let q = rotation::renormalized(q);
        // A smaller one says nothing either, and its noise would be no number.
        if weight < LEAST_WEIGHT {
            let Some(then) = self.orientation.at(seen) else {
                return Reply::Refused(Refusal::NotInHistory);
            };
            return Reply::Measured { angle: rotation::difference(q, then).length(), used: false };
        }
        let sigma = sigma / sqrt(weight);
        self.fuse(seen, |filter, then, since| filter.take_orientation(q, sigma, then, since))
    }

    fn align_direction(&mut self, body: Vec3, world: Vec3, sigma: Real, seen: u64) -> Reply {
        let unit = |v: Vec3| fabs(v.length_squared() - 1.0) < 1.0e-3;
        if !(unit(body) && unit(world) && SIGMA.contains(&sigma)) {
            return Reply::Refused(Refusal::NotFinite);
        }
        let pair = (body / sqrt(body.length_squared()), world / sqrt(world.length_squared()));
        self.fuse(seen, |filter, then, since| filter.take_direction(pair, sigma, then, since))
    }

    /// Gives the filter of the orientation a measurement of the tick `seen`, and corrects the
    /// orientation by what it finds.
    fn fuse(&mut self, seen: u64, take: impl FnOnce(&mut Uncertainty, Quat, Real) -> Fused) -> Reply {
        let Some(then) = self.orientation.corrected_at(seen) else {
            return Reply::Refused(Refusal::NotInHistory);
        };
        let since = self.drift.after(rotation::angle_between(self.orientation.corrected(), then));
        let filter = self.uncertainty.get_or_insert(Uncertainty::NOTHING_KNOWN);
        let Fused { correction, angle, used } = take(filter, rotation::renormalized(then), since);
        if used {
            self.orientation.correct_further(correction);
        }
        Reply::Measured { angle, used }
    }
}

/// Range of the standard deviation of a measured angle, rad. The filter divides by its square.
const SIGMA: core::ops::RangeInclusive<Real> = 1.0e-5..=PI;
/// Weight of a measurement below which it does not count.
const LEAST_WEIGHT: Real = 1.0e-12;

fn is_unit(q: Quat) -> bool {
    // A client that normalises its quaternions passes this check. The core does not guess the
    // meaning of others.
    fabs(q.length_squared() - 1.0) < 1.0e-3
}
