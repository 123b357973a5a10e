//! Equal motions give equal bits, for every kind of effect, on every machine and in every profile.

use super::{Felt, all};
use crate::prelude::*;

/// The hash of all torques. It changes when an effect computes something else; the test then prints
/// the new hash.
const GOLDEN: u64 = 0x276E_2D55_9EE4_81F7;

#[test]
fn every_kind_gives_the_same_bits_on_every_machine() {
    // FNV-1a over the bytes of the torques.
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut rng = Rng(60);
    for (kind, figures) in all() {
        let mut felt = Felt::with_numbers(kind, &figures);
        let (mut q, mut omega) = (Quat::IDENTITY, Vec3::ZERO);
        let mut felt_something = false;
        for _ in 0..3000 {
            omega = omega * 0.99 + rng.vector(1.0);
            q = rotation::renormalized(rotation::exp(omega * 1e-3) * q);
            let torque = felt.moving(q, omega);
            felt_something |= torque != Vec3::ZERO;
            for x in torque.to_array() {
                for byte in x.to_bits().to_le_bytes() {
                    hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
                }
            }
        }
        assert!(felt_something, "{kind:?}");
    }
    assert_eq!(hash, GOLDEN, "the torques hash to 0x{hash:016X}");
}
