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

            /// Returns a set without any flag.
            #[must_use]
            pub const fn empty() -> Self {
                Self(0)
            }

            /// Returns the set with exactly these bits, known or not.
            #[must_use]
            pub const fn from_bits(bits: u16) -> Self {
                Self(bits)
            }

            /// Returns the bits as they are sent on the line.
            #[must_use]
            pub const fn bits(self) -> u16 {
                self.0
            }

            /// Returns true if no flag is set, known or not.
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

            /// Returns the flags that are set in `self`, in `other` or in both.
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

        /// Writes the names of the set flags, and the unknown bits: `JointFlags(INDEX_SEEN |
        /// 0x8000)`.
        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write_names(f, stringify!($name), self.0, &[$((stringify!($flag), 1 << $bit)),*])
            }
        }
    };
}

flags! {
    /// The state of a motor controller, as a set of flags.
    ControllerFlags {
        /// The torques of the answered command are applied.
        ENABLED = 0;
        /// No valid command came in time. Torque is zero until a [`Command`](crate::Command) with
        /// `enable = false`.
        WATCHDOG_EXPIRED = 1;
        /// The controller found an internal fault (a driver, a supply, an encoder, a joint too
        /// hot). Torque is zero.
        FAULT = 2;
        /// Set from boot until a [`Describe`](crate::ToController::Describe) is answered. If a host
        /// has received the description and later sees this flag, the controller has rebooted and
        /// its counts started anew.
        UNDESCRIBED = 3;
    }
}

flags! {
    /// The state of one joint, as a set of flags.
    JointFlags {
        /// The encoder's index mark was passed since boot. From the first reading with this flag,
        /// `count` is 0 at the mark. The difference from the reading before it is not a motion.
        INDEX_SEEN = 0;
        /// The current is at the limit of motor or driver. The torque can be less than commanded.
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
