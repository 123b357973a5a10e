//! The simulated rig of an Hbot: plant, virtual motor controllers, a hand.
