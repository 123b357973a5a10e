//! The format of the golden files. An unknown field is refused, so that no field goes unchecked.

use serde::Deserialize;

pub type Vector = [f64; 3];
pub type Quaternion = [f64; 4];
pub type Matrix = [[f64; 3]; 3];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct File<Case> {
    /// Explanation for readers of the file.
    #[serde(rename = "about")]
    pub _about: String,
    pub cases: Vec<Case>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    pub sphere_radius: f64,
    pub sphere_mass: f64,
    pub wheels: Vec<Wheel>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wheel {
    pub axis: Vector,
    pub cone: f64,
    pub toe: f64,
    pub radius: f64,
    pub steer_inertia: f64,
    pub drive_inertia: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kinematics {
    pub device: Device,
    pub theta: Vec<f64>,
    pub contact_frames: Vec<[Vector; 3]>,
    pub det_h: f64,
    pub sigma_min_z: f64,
    pub g: Vec<Vector>,
    pub omega: Vector,
    pub joint_rates: Vec<f64>,
    pub noisy_joint_rates: Vec<f64>,
    pub omega_estimate: Vector,
    pub slip: Vec<f64>,
    pub indices: Indices,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Indices {
    pub lci_spectral: f64,
    pub lci_frobenius: f64,
    pub manipulability: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Odometry {
    pub device: Device,
    pub q0: Quaternion,
    pub theta0: Vec<f64>,
    pub segments: Vec<Segment>,
    pub q: Quaternion,
    pub theta: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    pub duration: f64,
    pub joint_rates: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hopf {
    pub theta: f64,
    pub phi: f64,
    pub psi: f64,
    pub q: Quaternion,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Impedance {
    pub q_desired: Quaternion,
    pub q_actual: Quaternion,
    pub error_eq24: Vector,
    pub rotation_vector: Vector,
    pub stiffness: Matrix,
    pub damping: Matrix,
    pub omega_desired: Vector,
    pub omega_actual: Vector,
    pub quaternion_law: Law,
    pub geodesic_law: Law,
    pub damper_torque: Vector,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Law {
    pub torque: Vector,
    pub energy: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Allocation {
    pub device: Device,
    pub theta: Vec<f64>,
    pub torque: Vector,
    pub limits: Vec<f64>,
    pub weights: Vec<f64>,
    pub scale: f64,
    pub joint_torques: Vec<f64>,
    pub cost: f64,
    pub capability: Vector,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dynamics {
    pub device: Device,
    pub theta: Vec<f64>,
    pub omega: Vector,
    pub torque: Vector,
    pub joint_torques: Vec<f64>,
    pub acceleration: Vector,
    pub energy: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trajectory {
    pub device: Device,
    pub q0: Quaternion,
    pub theta0: Vec<f64>,
    pub omega0: Vector,
    pub spring: Spring,
    pub drive: Vec<Sine>,
    pub samples: Vec<Sample>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    pub stiffness: f64,
    pub damping: f64,
    pub q_desired: Quaternion,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    pub axis: Vector,
    pub amplitude: f64,
    pub hertz: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    pub t: f64,
    pub q: Quaternion,
    pub joints: Vec<f64>,
    pub omega: Vector,
}
