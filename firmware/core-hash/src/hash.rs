//! A hash of the bits of all outputs of a tick. The same source serves both widths of the core.

use super::core as hbot;
use hbot::Real;
use hbot::outputs::{Outputs, Refusal, Reply};
use hbot::safety::shaking::Shaking;

/// The hash function FNV-1a over words (Fowler, Noll and Vo).
#[derive(Clone, Copy)]
pub(crate) struct Hash(pub(crate) u64);

impl Hash {
    /// The value that FNV-1a starts with.
    pub(crate) const START: Self = Self(0xCBF2_9CE4_8422_2325);

    pub(crate) fn word(&mut self, x: u64) {
        for byte in x.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }

    #[allow(clippy::useless_conversion, reason = "the bits of an f32 are fewer")]
    fn reals(&mut self, x: &[Real]) {
        x.iter().for_each(|x| self.word(u64::from(x.to_bits())));
    }

    fn reply(&mut self, reply: &Reply) {
        match *reply {
            Reply::Done => self.word(1),
            Reply::Aligned { angle } => self.reals(&[2.0, angle]),
            Reply::Measured { angle, used } => self.reals(&[9.0, angle, Real::from(u8::from(used))]),
            Reply::Refused(Refusal::TooFar { slot, angle }) => self.reals(&[3.0, Real::from(slot), angle]),
            Reply::Refused(Refusal::TooOld { age_ticks }) => self.word(age_ticks),
            Reply::Refused(Refusal::Mode(_)) => self.word(4),
            Reply::Refused(Refusal::NoReference) => self.word(5),
            Reply::Refused(Refusal::NotInHistory) => self.word(6),
            Reply::Refused(Refusal::NotFinite) => self.word(7),
            Reply::Refused(Refusal::Ahead { ticks }) => self.reals(&[8.0, ticks as Real]),
        }
    }

    pub(crate) fn outputs(&mut self, outputs: &Outputs) {
        let s = &outputs.state;
        self.word(s.tick);
        self.word(s.mode as u64);
        self.word(s.cause.map_or(99, |cause| cause as u64));
        self.reals(&s.q.to_array());
        self.reals(&s.omega.to_array());
        self.reals(&s.reference.map_or([0.0; 4], |q| q.to_array()));
        self.reals(&s.torque.to_array());
        self.reals(&s.angle);
        self.reals(&s.rate);
        self.reals(&s.joint_torque);
        self.reals(&[s.slip, s.scale, s.traction, s.energy]);
        self.word(u64::from(s.deficient) << 1 | u64::from(s.fresh));
        self.word(s.client.map_or(u64::MAX, |client| client.age_ticks));
        self.word(u64::from(outputs.drive.enable));
        self.reals(&outputs.drive.torque);
        outputs.replies.iter().flatten().for_each(|reply| self.reply(reply));
    }

    /// Hashes all outputs, also those that [`outputs`](Self::outputs) leaves out.
    pub(crate) fn all(&mut self, outputs: &Outputs) {
        self.outputs(outputs);
        let s = &outputs.state;
        self.reals(&[s.damping, s.lead_us]);
        self.reals(&s.sigma.map_or([0.0; 3], |sigma| sigma.to_array()));
        self.word(s.client.and_then(|client| client.seq).unwrap_or(u64::MAX));
        if let Some(Shaking { tick, frequency, amplitude, slot, gain }) = s.shaking {
            self.word(tick << 8 | u64::from(slot.unwrap_or(u8::MAX)));
            self.reals(&[frequency, amplitude, gain]);
        }
    }
}
