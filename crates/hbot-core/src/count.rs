//! The number of wheels of a device, as the stages of a tick use it.
//!
//! A tick consists of short loops over wheels and joints. If the compiler knows how often a loop
//! runs, it needs no counter, no bounds check and no zeros for wheels that are not there. So the
//! tick is compiled twice from one source: for [`Two`] wheels, the common design, and for [`Any`]
//! number. Both copies do the same operations in the same order and give the same bits.

/// Largest number of wheels of a device.
pub const MAX_WHEELS: usize = 8;
/// Largest number of joints of a device: the steer and the drive joint of each wheel, in that
/// order.
pub const MAX_JOINTS: usize = 2 * MAX_WHEELS;

/// A number of wheels, 2 to [`MAX_WHEELS`], which the compiler may know.
pub(crate) trait Count: Copy {
    /// Returns the number of wheels.
    fn wheels(self) -> usize;

    /// Returns the number of joints: two per wheel, steer then drive.
    #[inline]
    fn joints(self) -> usize {
        2 * self.wheels()
    }
}

/// Two wheels, known at compile time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Two;

impl Count for Two {
    #[inline]
    fn wheels(self) -> usize {
        2
    }
}

/// A number of wheels that is known only at run time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Any(usize);

impl Any {
    /// A number of `wheels`.
    #[inline]
    pub(crate) fn new(wheels: usize) -> Self {
        Self(wheels)
    }
}

impl Count for Any {
    #[inline]
    fn wheels(self) -> usize {
        self.0
    }
}
