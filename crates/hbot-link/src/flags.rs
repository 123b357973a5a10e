//! Sets of flags, 16 bits wide. Unknown bits are kept unchanged, so that newer controllers can use
//! them.

use core::{fmt, ops};
use serde::{Deserialize, Serialize};

macro_rules! flags {
    ($(#[$about:meta])* $name:ident { $($(#[$doc:meta])* $flag:ident = $bit:literal;)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(u16);

        impl $name {
            $($(#[$doc])* pub const $flag: Self = Self(1 << $bit);)*

            /// Returns a set in which no flag is set.
            #[must_use]
            pub const fn empty() -> Self {
                Self(0)
            }

            /// Returns the set with the given bits. Bits without a name are kept.
            #[must_use]
            pub const fn from_bits(bits: u16) -> Self {
                Self(bits)
            }

            /// Returns the bits of the set, as they are sent on the line.
            #[must_use]
            pub const fn bits(self) -> u16 {
                self.0
            }

            /// Returns true if no bit is set, with or without a name.
            #[must_use]
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }

            /// Returns true if all flags of `other` are set.
            #[must_use]
            pub const fn contains(self, other: Self) -> bool {
                self.0 & other.0 == other.0
            }

            /// Returns true if at least one flag of `other` is set.
            #[must_use]
            pub const fn intersects(self, other: Self) -> bool {
                self.0 & other.0 != 0
            }

            /// Returns the flags that are set in `self`, in `other`, or in both.
            #[must_use]
            pub const fn union(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }

            /// Returns the flags that are set in `self` but not in `other`.
            #[must_use]
            pub const fn difference(self, other: Self) -> Self {
                Self(self.0 & !other.0)
            }

            /// Sets all flags of `other` if `on` is true, otherwise clears them.
            pub const fn set(&mut self, other: Self, on: bool) {
                *self = if on { self.union(other) } else { self.difference(other) };
            }
        }

        impl ops::BitOr for $name {
            type Output = Self;

            fn bitor(self, other: Self) -> Self {
                self.union(other)
            }
        }

        impl ops::BitOrAssign for $name {
            fn bitor_assign(&mut self, other: Self) {
                *self = self.union(other);
            }
        }

        /// Writes the names of all set flags, and set bits without a name as a number. Example:
        /// `JointFlags(INDEX_SEEN | 0x8000)`.
        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write_names(f, stringify!($name), self.0, &[$((stringify!($flag), 1 << $bit)),*])
            }
        }
    };
}

flags! {
    /// The state of a motor controller as a set of flags.
    ControllerFlags {
        /// The motor controller applies the torques of the command that it answers.
        ENABLED = 0;
        /// The watchdog expired: no valid command came in time. The torque is zero until a
        /// [`Command`](crate::Command) with `enable = false` arrives.
        WATCHDOG_EXPIRED = 1;
        /// The motor controller found an internal fault, for example in a driver, a supply or an
        /// encoder, or a joint that is too hot. The torque is zero.
        FAULT = 2;
        /// Set from boot until the motor controller answers a
        /// [`Describe`](crate::ToController::Describe). If the host sees this flag after it has
        /// received the description, the controller has rebooted and its encoder counts have
        /// started anew.
        UNDESCRIBED = 3;
    }
}

flags! {
    /// The state of one joint as a set of flags.
    JointFlags {
        /// The encoder has passed its index mark since boot. From the first reading with this flag
        /// on, `count` is measured from the mark. So the difference between this reading and the
        /// one before it is not a motion.
        INDEX_SEEN = 0;
        /// The current has reached the limit of the motor or its driver. The torque can be less
        /// than commanded.
        OVERCURRENT = 1;
        /// The motor or its driver is hotter than allowed.
        OVERTEMPERATURE = 2;
    }
}

fn write_names(f: &mut fmt::Formatter<'_>, name: &str, bits: u16, known: &[(&str, u16)]) -> fmt::Result {
    write!(f, "{name}(")?;
    let mut unnamed = bits;
    let mut separator = "";
    for (flag, bit) in known.iter().filter(|(_, bit)| bits & bit != 0) {
        write!(f, "{separator}{flag}")?;
        separator = " | ";
        unnamed &= !bit;
    }
    if unnamed != 0 {
        write!(f, "{separator}{unnamed:#06x}")?;
    }
    write!(f, ")")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn sets_combine() {
        let mut flags = ControllerFlags::ENABLED | ControllerFlags::FAULT;
        assert_eq!(flags.bits(), 0b101);
        assert!(flags.contains(ControllerFlags::FAULT) && !flags.contains(ControllerFlags::UNDESCRIBED));
        assert!(!flags.contains(ControllerFlags::FAULT | ControllerFlags::UNDESCRIBED));
        assert!(flags.intersects(ControllerFlags::FAULT | ControllerFlags::UNDESCRIBED));
        flags.set(ControllerFlags::ENABLED, false);
        assert_eq!(flags, ControllerFlags::FAULT);
        flags |= ControllerFlags::UNDESCRIBED;
        assert_eq!(flags.difference(ControllerFlags::FAULT), ControllerFlags::UNDESCRIBED);
        assert!(ControllerFlags::default().is_empty() && !flags.is_empty());
    }

    #[test]
    fn debug_names_what_is_set() {
        assert_eq!(format!("{:?}", JointFlags::empty()), "JointFlags()");
        assert_eq!(
            format!("{:?}", JointFlags::from_bits(0x8003)),
            "JointFlags(INDEX_SEEN | OVERCURRENT | 0x8000)"
        );
    }
}
