//! A method for each op.

use super::connect::typed;
use super::{Client, ClientError};
use crate::{
    Align, AlignOk, InfoOk, LoadSceneOk, Mode, ModeOk, Op, PingOk, ReferenceCommand, StatsOk, SubscribeOk,
    TorqueCommand,
};
use serde_json::{Map, Value};

/// Each waits for the answer and fails as [`Client::call`] does, but for the two streams [`torque`](Client::torque) and
/// [`reference`](Client::reference), which are sent as [`Client::send`] does.
impl Client {
    /// What the rig is and can do, the effects and their parameters, the scene.
    pub fn info(&mut self) -> Result<InfoOk, ClientError> {
        self.call(Op::Info).and_then(typed)
    }

    /// Histograms and counters of the loop.
    pub fn stats(&mut self) -> Result<StatsOk, ClientError> {
        self.call(Op::Stats).and_then(typed)
    }

    /// Asks for a state every so many ticks, from 1 to [`MAX_EVERY`](crate::MAX_EVERY).
    pub fn subscribe(&mut self, every: u64) -> Result<SubscribeOk, ClientError> {
        self.call(Op::Subscribe { every }).and_then(typed)
    }

    /// Asks for no more states.
    pub fn unsubscribe(&mut self) -> Result<(), ClientError> {
        self.call(Op::Unsubscribe).map(drop)
    }

    /// Takes the lease to command, with `steal` even from another.
    pub fn acquire(&mut self, steal: bool) -> Result<(), ClientError> {
        self.call(Op::Acquire { steal }).map(drop)
    }

    /// Gives the lease back.
    pub fn release(&mut self) -> Result<(), ClientError> {
        self.call(Op::Release).map(drop)
    }

    /// Renders another scene, a map of the shape of a scene file.
    pub fn load_scene(&mut self, scene: Value) -> Result<LoadSceneOk, ClientError> {
        self.call(Op::LoadScene { scene }).and_then(typed)
    }

    /// Changes parameters of an effect, ramped.
    pub fn set(&mut self, effect: &str, parameters: Map<String, Value>) -> Result<(), ClientError> {
        self.call(Op::Set { effect: effect.into(), parameters }).map(drop)
    }

    /// Sends a torque that the client renders itself, without waiting.
    pub fn torque(&mut self, command: TorqueCommand) -> Result<(), ClientError> {
        self.send(Op::Torque(command))
    }

    /// Moves an effect's reference, without waiting.
    pub fn reference(&mut self, command: ReferenceCommand) -> Result<(), ClientError> {
        self.send(Op::Reference(command))
    }

    /// Tells the orientation seen from outside. Answers how far the server's own is off, rad.
    pub fn align(&mut self, align: Align) -> Result<f64, ClientError> {
        self.call(Op::Align(align)).and_then(typed).map(|AlignOk { angle }| angle)
    }

    /// Begins to render. Answers the mode from the next tick on.
    pub fn enable(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Enable)
    }

    /// Stops rendering. Answers the mode from the next tick on.
    pub fn disable(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Disable)
    }

    /// Leaves a fault or an emergency stop. Answers the mode from the next tick on.
    pub fn reset(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Reset)
    }

    /// Stops at once. Answers the mode from the next tick on.
    pub fn estop(&mut self) -> Result<Mode, ClientError> {
        self.mode(Op::Estop)
    }

    /// Asks for a sign of life; `data` comes back as it is.
    pub fn ping(&mut self, data: Value) -> Result<PingOk, ClientError> {
        self.call(Op::Ping { data }).and_then(typed)
    }

    fn mode(&mut self, op: Op) -> Result<Mode, ClientError> {
        self.call(op).and_then(typed).map(|ModeOk { mode }| mode)
    }
}
