//! One method of the client for each op.

use super::connect::typed;
use super::{Client, ClientError};
use crate::{
    Align, AlignDirection, AlignOk, ControllerInfo, ControllersOk, HandCommand, InfoOk, LoadSceneOk, Mode,
    ModeOk, ModelCommand, ModelOk, Op, PingOk, ReferenceCommand, SetOk, StateEvent, StatsOk, SubscribeOk,
    TorqueCommand,
};
use serde_json::{Map, Value};

/// One method for each op. Each method waits for the answer and fails like [`Client::call`]. Only
/// [`torque`](Client::torque), [`reference`](Client::reference) and [`model`](Client::model), which
/// are called repeatedly, do not wait and fail like [`Client::send`].
impl Client {
    /// Asks for the description of the rig, the kinds of effects with their parameters, and the
    /// running scene.
    pub fn info(&mut self) -> Result<InfoOk, ClientError> {
        self.call(Op::Info).and_then(typed)
    }

    /// Asks for the statistics and counters of the control loop and the service.
    pub fn stats(&mut self) -> Result<StatsOk, ClientError> {
        self.call(Op::Stats).and_then(typed)
    }

    /// Asks what the motor controller of each joint reports about itself. The result has the order
    /// of the joints in state messages.
    pub fn controllers(&mut self) -> Result<Vec<ControllerInfo>, ClientError> {
        let answer: ControllersOk = self.call(Op::Controllers).and_then(typed)?;
        Ok(answer.controllers)
    }

    /// Subscribes to one state message every `every` ticks, from 1 to
    /// [`MAX_EVERY`](crate::MAX_EVERY).
    pub fn subscribe(&mut self, every: u64) -> Result<SubscribeOk, ClientError> {
        self.call(Op::Subscribe { every }).and_then(typed)
    }

    /// Ends the subscription to state messages.
    pub fn unsubscribe(&mut self) -> Result<(), ClientError> {
        self.call(Op::Unsubscribe).map(drop)
    }

    /// Takes the lease, which is the right to command. If `steal` is true, takes it even if another
    /// client holds it.
    pub fn acquire(&mut self, steal: bool) -> Result<(), ClientError> {
        self.call(Op::Acquire { steal }).map(drop)
    }

    /// Gives the lease back, so that another client can take it.
    pub fn release(&mut self) -> Result<(), ClientError> {
        self.call(Op::Release).map(drop)
    }

    /// Loads another scene and starts to render it. `scene` is a map with the structure of a scene
    /// file, or the name of a ready-made scene.
    pub fn load_scene(&mut self, scene: Value) -> Result<LoadSceneOk, ClientError> {
        self.call(Op::LoadScene { scene }).and_then(typed)
    }

    /// Changes parameters of an effect in the running scene. The torque changes gradually.
    pub fn set(&mut self, effect: &str, parameters: Map<String, Value>) -> Result<SetOk, ClientError> {
        self.call(Op::Set { effect: effect.into(), parameters }).and_then(typed)
    }

    /// Sends a torque that the client computes itself, without waiting for an answer. Call it again
    /// before the torque expires.
    pub fn torque(&mut self, command: TorqueCommand) -> Result<(), ClientError> {
        self.send(Op::Torque(command))
    }

    /// Sends a new reference orientation for an effect, without waiting for an answer. Call it
    /// again for each new orientation.
    pub fn reference(&mut self, command: ReferenceCommand) -> Result<(), ClientError> {
        self.send(Op::Reference(command))
    }

    /// Sends a local model of the torque, without waiting for an answer. Call it again before the
    /// model expires.
    pub fn model(&mut self, command: ModelCommand) -> Result<(), ClientError> {
        self.send(Op::Model(Box::new(command)))
    }

    /// Sends a local model of the torque, and waits for the answer. So a program that begins to
    /// stream learns whether the server refuses its models or softens them.
    pub fn try_model(&mut self, command: ModelCommand) -> Result<ModelOk, ClientError> {
        self.call(Op::Model(Box::new(command))).and_then(typed)
    }

    /// Sends the sphere's orientation as measured from outside, for example by a camera. Returns
    /// the angle between it and the server's own orientation, rad.
    pub fn align(&mut self, align: Align) -> Result<f64, ClientError> {
        self.call(Op::Align(align)).and_then(typed).map(|AlignOk { angle, .. }| angle)
    }

    /// Sends a direction of the sphere as measured, for example that of gravity. Returns the angle
    /// between it and the server's own, and whether it is used.
    pub fn align_direction(&mut self, direction: AlignDirection) -> Result<AlignOk, ClientError> {
        self.call(Op::AlignDirection(direction)).and_then(typed)
    }

    /// Moves the hand of a simulated rig, without waiting for an answer. A real rig has none.
    pub fn hand(&mut self, command: HandCommand) -> Result<(), ClientError> {
        self.send(Op::Hand(command))
    }

    /// Begins to render the scene; the torque rises gradually. Returns the mode from the next tick
    /// on.
    pub fn enable(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Enable)
    }

    /// Ends rendering; the torque falls gradually. Returns the mode from the next tick on.
    pub fn disable(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Disable)
    }

    /// Ends a fault or an emergency stop. Returns the mode from the next tick on.
    pub fn reset(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Reset)
    }

    /// Performs an emergency stop: the torque is zero at once. Returns the mode from the next tick
    /// on.
    pub fn estop(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Estop)
    }

    /// Makes a simulated rig in virtual time run `ticks` ticks, from 1 to
    /// [`MAX_EVERY`](crate::MAX_EVERY), and then wait. Returns the state of the last of them. A
    /// torque or a model that was sent before acts in all of them.
    pub fn advance(&mut self, ticks: u64) -> Result<StateEvent, ClientError> {
        self.call(Op::Advance { ticks }).and_then(typed)
    }

    /// Tests whether the server answers. The answer contains `data` unchanged.
    pub fn ping(&mut self, data: Value) -> Result<PingOk, ClientError> {
        self.call(Op::Ping { data }).and_then(typed)
    }

    fn mode(&mut self, op: Op) -> Result<Mode, ClientError> {
        self.call(op).and_then(typed).map(|ModeOk { mode }| mode)
    }
}
