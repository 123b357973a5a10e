//! Vectors and quaternions for other programs.

#![allow(rustdoc::broken_intra_doc_links, reason = "annotations for cbindgen look like links")]

use hbot_api::Axes;

use crate::boundary::{Out, guarded, input};
use crate::status::{Failure, HbotStatus};

/// Axes of other programs. docs/axes.md has the table.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub enum HbotAxes {
    /// ROS: x forward, y left, z up.
    Ros = 0,
    /// Unity: x right, y up, z forward, left-handed.
    Unity = 1,
    /// Unreal: x forward, y right, z up, left-handed.
    Unreal = 2,
    /// CHAI3D: x towards the person, y right, z up.
    Chai3d = 3,
}

/// Converts one value.
///
/// # Safety
/// The contract of the crate holds for both pointers.
unsafe fn convert<const N: usize>(
    axes: u32,
    from: *const f64,
    to: *mut f64,
    by: fn(Axes, [f64; N]) -> [f64; N],
) -> HbotStatus {
    guarded(|| {
        let axes = match axes {
            0 => Axes::Ros,
            1 => Axes::Unity,
            2 => Axes::Unreal,
            3 => Axes::Chai3d,
            other => return Err(Failure::argument(format!("axes is {other}; legal: 0 to 3"))),
        };
        // SAFETY: the contract of all functions, stated at the crate.
        let (from, to) = unsafe { (*input(from.cast(), "from")?, Out::new(to.cast(), "to")?) };
        to.write(by(axes, from));
        Ok(HbotStatus::Ok)
    })
}

/// Converts a direction, a force or a velocity from frame N to `axes`, one of hbot_axes. `from` and
/// `to` can be equal, as in all functions here.
/// cbindgen:ptrs-as-arrays=[[from;3], [to;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_vector_to(axes: u32, from: *const f64, to: *mut f64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { convert(axes, from, to, Axes::vector) }
}

/// Converts a direction, a force or a velocity from `axes` to frame N.
/// cbindgen:ptrs-as-arrays=[[from;3], [to;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_vector_from(axes: u32, from: *const f64, to: *mut f64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { convert(axes, from, to, Axes::vector_to_n) }
}

/// Converts a torque, an angular velocity or a rotation vector from frame N to `axes`.
/// cbindgen:ptrs-as-arrays=[[from;3], [to;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_axial_to(axes: u32, from: *const f64, to: *mut f64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { convert(axes, from, to, Axes::axial) }
}

/// Converts a torque, an angular velocity or a rotation vector from `axes` to frame N.
/// cbindgen:ptrs-as-arrays=[[from;3], [to;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_axial_from(axes: u32, from: *const f64, to: *mut f64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { convert(axes, from, to, Axes::axial_to_n) }
}

/// Converts an orientation {w, x, y, z} in frame N to `axes`: {w, x, y, z} for CHAI3D, {x, y, z, w}
/// for the others.
/// cbindgen:ptrs-as-arrays=[[from;4], [to;4]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_quaternion_to(axes: u32, from: *const f64, to: *mut f64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { convert(axes, from, to, Axes::quaternion) }
}

/// Converts an orientation in `axes`, in the order of hbot_quaternion_to(), to {w, x, y, z} in
/// frame N.
/// cbindgen:ptrs-as-arrays=[[from;4], [to;4]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_quaternion_from(axes: u32, from: *const f64, to: *mut f64) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe { convert(axes, from, to, Axes::quaternion_to_n) }
}
