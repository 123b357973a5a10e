//! The real-time loop, serial ports and TCP service of an Hbot.
