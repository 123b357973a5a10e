//! Converts between frame N and the axes of ROS, Unity, Unreal and CHAI3D. `docs/axes.md` has the
//! table and the reasons.
//!
//! All conversions assume that the person sits on the side of -n2 and looks along n2. Then n1
//! points to the right, n2 away from the person, and n3 upwards.

use crate::names::names;

names! {
    /// A convention of axes, to which vectors and quaternions of frame N can be converted.
    pub enum Axes {
        /// ROS (REP 103): x forward, y to the left, z up, right-handed.
        Ros = "ros",
        /// Unity: x to the right, y up, z forward, left-handed.
        Unity = "unity",
        /// Unreal: x forward, y to the right, z up, left-handed. Lengths are in centimetres.
        Unreal = "unreal",
        /// CHAI3D: x towards the person, y to the right, z up, right-handed.
        Chai3d = "chai3d",
    }
}

/// One axis of a convention: the index of its axis of frame N, and whether it points along that
/// axis (1) or against it (-1).
type Axis = (usize, f64);

impl Axes {
    /// Returns the axes x, y, z of this convention as axes of frame N.
    const fn xyz(self) -> [Axis; 3] {
        match self {
            Self::Ros => [(1, 1.0), (0, -1.0), (2, 1.0)],
            Self::Unity => [(0, 1.0), (2, 1.0), (1, 1.0)],
            Self::Unreal => [(1, 1.0), (0, 1.0), (2, 1.0)],
            Self::Chai3d => [(1, -1.0), (0, 1.0), (2, 1.0)],
        }
    }

    /// Returns 1 for a right-handed convention and -1 for a left-handed one.
    #[must_use]
    pub const fn handedness(self) -> f64 {
        match self {
            Self::Ros | Self::Chai3d => 1.0,
            Self::Unity | Self::Unreal => -1.0,
        }
    }

    /// Returns the number of this convention's units of length in one metre.
    #[must_use]
    pub const fn units_per_metre(self) -> f64 {
        match self {
            Self::Unreal => 100.0,
            Self::Ros | Self::Unity | Self::Chai3d => 1.0,
        }
    }

    /// Converts a direction, a force or a linear velocity from frame N to these axes. Does not
    /// change its unit; multiply lengths by [`units_per_metre`](Self::units_per_metre).
    #[must_use]
    pub const fn vector(self, n: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.xyz();
        [x.1 * n[x.0], y.1 * n[y.0], z.1 * n[z.0]]
    }

    /// Converts a direction, a force or a linear velocity from these axes to frame N. The inverse
    /// of [`vector`](Self::vector).
    #[must_use]
    pub const fn vector_to_n(self, v: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.xyz();
        let mut n = [0.0; 3];
        n[x.0] = x.1 * v[0];
        n[y.0] = y.1 * v[1];
        n[z.0] = z.1 * v[2];
        n
    }

    /// Converts a torque, an angular velocity or a rotation vector from frame N to these axes. In a
    /// left-handed convention such a vector also changes its sign, because the direction of a
    /// positive turn about an axis is the other one there.
    #[must_use]
    pub const fn axial(self, n: [f64; 3]) -> [f64; 3] {
        scaled(self.vector(n), self.handedness())
    }

    /// Converts a torque, an angular velocity or a rotation vector from these axes to frame N. The
    /// inverse of [`axial`](Self::axial).
    #[must_use]
    pub const fn axial_to_n(self, v: [f64; 3]) -> [f64; 3] {
        scaled(self.vector_to_n(v), self.handedness())
    }

    /// Converts an orientation `[w, x, y, z]` of the sphere in frame N to these axes. Returns it in
    /// the order in which programs with this convention write a quaternion: `[w, x, y, z]` for
    /// CHAI3D, and `[x, y, z, w]` for the others.
    ///
    /// The axes of the sphere are renamed in the same way as those of the room. So the converted
    /// quaternion turns converted vectors: it turns `vector(v)` into `vector(q v)`.
    #[must_use]
    pub const fn quaternion(self, q: [f64; 4]) -> [f64; 4] {
        let [w, x, y, z] = q;
        let [x, y, z] = self.axial([x, y, z]);
        if self.scalar_first() { [w, x, y, z] } else { [x, y, z, w] }
    }

    /// Converts an orientation in these axes, in the order of [`quaternion`](Self::quaternion), to
    /// `[w, x, y, z]` in frame N.
    #[must_use]
    pub const fn quaternion_to_n(self, q: [f64; 4]) -> [f64; 4] {
        let [w, x, y, z] = if self.scalar_first() { q } else { [q[3], q[0], q[1], q[2]] };
        let [x, y, z] = self.axial_to_n([x, y, z]);
        [w, x, y, z]
    }

    /// Returns whether programs with this convention write the scalar part of a quaternion first.
    const fn scalar_first(self) -> bool {
        matches!(self, Self::Chai3d)
    }
}

const fn scaled(v: [f64; 3], factor: f64) -> [f64; 3] {
    [v[0] * factor, v[1] * factor, v[2] * factor]
}
