//! Local models: a torque, and how it changes as the sphere turns.

use hbot_api::{Impedance, ModelCommand, PlaneCommand};

use crate::boundary::{Out, input};
use crate::client::{HbotClient, with};
use crate::ops::{HbotStream, extras};
use crate::status::{Failure, HbotStatus};

/// Largest number of half-spaces of a model.
pub const HBOT_MAX_PLANES: usize = 8;

/// A half-space of turns that pushes the sphere back, such as a contact. It never pulls.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbotPlane {
    /// Axis in frame N about which a turn leads into it.
    pub normal: [f64; 3],
    /// Turn from the model's pose at which it begins, rad. Negative: the pose is inside.
    pub offset: f64,
    /// Stiffness, N m/rad.
    pub stiffness: f64,
    /// Damping inside, N m s/rad.
    pub damping: f64,
}

/// The torque near a pose: `torque` - `stiffness` * turn - `damping` * angular velocity - `planes`.
/// All fields 0 is no torque.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbotLocalModel {
    /// Torque at the pose in frame N, N m.
    pub torque: [f64; 3],
    /// Rows of the stiffness in frame N, N m/rad: symmetric, no eigenvalue below 0.
    pub stiffness: [[f64; 3]; 3],
    /// Rows of the damping in frame N, N m s/rad: symmetric, no eigenvalue below 0.
    pub damping: [[f64; 3]; 3],
    /// Whether `pose` counts. If not, the stiffness acts about the orientation of the state with
    /// the number `tick` of the stream, or about the present one if that is 0.
    pub has_pose: bool,
    /// Orientation about which the stiffness acts, {w, x, y, z}.
    pub pose: [f64; 4],
    /// Number of planes, at most HBOT_MAX_PLANES.
    pub plane_count: u32,
    /// The planes.
    pub planes: [HbotPlane; HBOT_MAX_PLANES],
    /// Time in which the torque of before blends into this one, ms, at most 200. 0: the time since
    /// the last model, at most 50 ms.
    pub blend_ms: u32,
    /// Whether the server may render a model that the loop does not keep stable with less
    /// stiffness. If not, it refuses it.
    pub soften: bool,
}

/// Streams a local model. The server renders it in every tick until it expires or the next model
/// comes. `stream` can be NULL. `scale` can be NULL: then the function does not wait for an answer,
/// and if the server refuses the model, an event HBOT_EVENT_KIND_REFUSED comes. Otherwise it
/// receives the fraction of the stiffness that is rendered.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_model(
    client: *mut HbotClient,
    model: *const HbotLocalModel,
    stream: *const HbotStream,
    scale: *mut f64,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let (model, extras) = (input(model, "model")?, extras(stream));
            if model.plane_count as usize > HBOT_MAX_PLANES {
                let text = format!("plane_count is {}; legal: at most {HBOT_MAX_PLANES}", model.plane_count);
                return Err(Failure::new(HbotStatus::BadArgument, text));
            }
            let planes = model.planes.iter().take(model.plane_count as usize);
            let command = ModelCommand {
                torque: model.torque,
                stiffness: Impedance::Matrix(model.stiffness),
                damping: Impedance::Matrix(model.damping),
                pose: model.has_pose.then_some(model.pose),
                planes: planes.map(plane).collect(),
                valid_ms: extras.valid_ms,
                blend_ms: (model.blend_ms > 0).then_some(model.blend_ms.into()),
                soften: model.soften,
                tick: extras.tick,
                seq: extras.seq,
            };
            if let Ok(out) = Out::new(scale, "scale") {
                out.write(inner.client.try_model(command)?.stiffness_scale);
            } else {
                inner.client.model(command)?;
            }
            Ok(HbotStatus::Ok)
        })
    }
}

fn plane(plane: &HbotPlane) -> PlaneCommand {
    let HbotPlane { normal, offset, stiffness, damping } = *plane;
    PlaneCommand { normal, offset, stiffness, damping }
}
