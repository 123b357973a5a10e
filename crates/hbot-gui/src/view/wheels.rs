//! The contact of a wheel with the sphere (docs/internals/physics.md, section 1): C = A0 Rz(th)
//! Rx(a) Rz(b), contact point R c3.

use glam::{DQuat, DVec3};

use hbot_api::{RigInfo, WheelInfo};

/// Where and in which direction a wheel touches the sphere. Lengths are in units of the sphere's
/// radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contact {
    /// Steering axis of the wheel, a unit vector in frame N.
    pub(crate) axis: DVec3,
    /// Direction in which the wheel rolls, a unit vector in frame N.
    pub(crate) rolling: DVec3,
    /// Outward normal of the sphere at the contact, a unit vector in frame N. It is also the
    /// position of the contact.
    pub(crate) normal: DVec3,
    /// Radius of the wheel, in units of the sphere's radius.
    pub(crate) radius: f64,
}

impl Contact {
    /// Computes where a wheel of `rig` touches the sphere at the steer angle `steer`, rad. Returns
    /// `None` if the rig's geometry is not known.
    pub(crate) fn of(rig: &RigInfo, wheel: &WheelInfo, steer: f64) -> Option<Self> {
        let axis = DVec3::from(wheel.axis).try_normalize()?;
        if !(rig.sphere.radius > 0.0) {
            return None;
        }
        // For an axis along -n3 the smallest rotation is not unique. Use a half turn about n1.
        let a0 = if axis.z < -1.0 + 1e-9 {
            DQuat::from_rotation_x(std::f64::consts::PI)
        } else {
            DQuat::from_rotation_arc(DVec3::Z, axis)
        };
        let c = a0
            * DQuat::from_rotation_z(steer)
            * DQuat::from_rotation_x(wheel.cone)
            * DQuat::from_rotation_z(wheel.toe);
        let radius = wheel.radius / rig.sphere.radius;
        Some(Self { axis, rolling: c * DVec3::Y, normal: c * DVec3::Z, radius })
    }

    /// Returns the position of the wheel's centre, in units of the sphere's radius.
    pub(crate) fn centre(&self) -> DVec3 {
        self.normal * (1.0 + self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hbot_api::SphereInfo;

    fn rig(radius: f64) -> RigInfo {
        RigInfo { sphere: SphereInfo { radius, mass: 1.0 }, ..RigInfo::default() }
    }

    #[test]
    fn the_contact_keeps_its_angles_whatever_the_steering() {
        let rig = rig(0.1);
        for axis in [[1.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]] {
            let wheel = WheelInfo { axis, cone: 0.3, toe: 0.2, radius: 0.01, ..WheelInfo::default() };
            for steer in [0.0, 1.0, 4.0] {
                let contact = Contact::of(&rig, &wheel, steer).expect("geometry");
                // l.c2 = sin a cos b and l.c3 = cos a, with a tolerance for rounding.
                assert!((contact.axis.dot(contact.rolling) - 0.3_f64.sin() * 0.2_f64.cos()).abs() < 1e-12);
                assert!((contact.axis.dot(contact.normal) - 0.3_f64.cos()).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_first_contact_of_the_prototype_is_where_the_rig_file_says() {
        let rig = rig(0.102);
        let wheel = WheelInfo { axis: [0.0, 0.0, 1.0], cone: 0.1745, radius: 0.0155, ..WheelInfo::default() };
        let contact = Contact::of(&rig, &wheel, 0.0).expect("geometry");
        // Rx(a) n3 = (0, -sin a, cos a)
        let expected = DVec3::new(0.0, -0.1745_f64.sin(), 0.1745_f64.cos());
        assert!((contact.normal - expected).length() < 1e-12, "{contact:?}");
    }
}
