//! Local models of clients: they are checked here, and rendered by the loop.

use hbot_api::{ErrorBody, ErrorCode, Impedance, ModelCommand as Request};
use hbot_config::RigConfig;
use hbot_config::advice::{ModelBound, StiffnessBound, UnstableModel, smallest_eigenvalue};
use hbot_core::Mat3;
use hbot_core::render::model::{HalfSpace, LocalModel};

use super::convert;

/// Eigenvalue below 0 that counts as 0, relative to the largest element of the matrix. A matrix of
/// 32-bit numbers of less than full rank has such eigenvalues.
const ROUNDING: f64 = 1.0e-6;
/// Smallest eigenvalue of a matrix that the loop gets, relative to its largest element.
const RESERVE: f64 = 1.0e-7;

/// Knows which models the rig keeps stable.
pub(super) struct Models {
    /// `None` if the inertias in the rig file contradict each other. Then stability is not judged.
    bound: Option<ModelBound>,
    rate_hz: u32,
}

impl Models {
    pub(super) fn new(config: &RigConfig) -> Self {
        let bound = StiffnessBound::of(config).map(|springs| ModelBound::new(&springs));
        Self { bound, rate_hz: config.rate_hz }
    }

    /// Returns the model that the loop is to render, and the fraction of the requested stiffness
    /// that it has.
    ///
    /// # Errors
    /// Fails if a stiffness or damping has an eigenvalue below 0, or if the loop does not keep the
    /// model stable and the client has not allowed to soften it.
    #[inline(never)]
    pub(super) fn checked(&self, request: &Request) -> Result<(LocalModel, f64), ErrorBody> {
        let mut model = LocalModel::new(
            convert::vector(request.torque),
            matrix("stiffness", &request.stiffness)?,
            matrix("damping", &request.damping)?,
            request.pose.map(convert::quaternion),
        );
        for plane in &request.planes {
            // There are no more than the parser has let pass.
            let _ = model.add_plane(HalfSpace {
                normal: convert::vector(plane.normal),
                offset: plane.offset,
                stiffness: plane.stiffness,
                damping: plane.damping,
            });
        }
        let Some(bound) = &self.bound else { return Ok((model, 1.0)) };
        let unstable = |found: UnstableModel| self.unstable(&found, !request.planes.is_empty());
        if !request.soften {
            return bound.check(&model).map(|()| (model, 1.0)).map_err(unstable);
        }
        let part = bound.softened(&model).map_err(unstable)?;
        if part < 1.0 {
            model.soften(part);
        }
        Ok((model, part))
    }

    fn unstable(&self, found: &UnstableModel, planes: bool) -> ErrorBody {
        let UnstableModel { axis, stiffness, damping, stable, most_damping } = *found;
        let axis = axis.to_array().map(|x| (x * 100.0).round() / 100.0 + 0.0);
        let rate = self.rate_hz;
        let entered = if planes { " with all planes entered" } else { "" };
        let message = if damping >= most_damping {
            format!(
                "op model: it may shake the sphere about {axis:?}: the damping, {damping:.3} N m s/rad{entered}, acts too late; at {rate} Hz legal: less than {most_damping:.3}"
            )
        } else {
            format!(
                "op model: it may shake the sphere about {axis:?}: it has {stiffness:.2} N m/rad and a damping of {damping:.4} N m s/rad{entered}; at {rate} Hz legal with this damping: at most {stable:.2} N m/rad. Send less stiffness, more damping, or soften = true"
            )
        };
        ErrorBody::new(ErrorCode::OutOfRange, message)
    }
}

/// Returns a stiffness or damping as a matrix.
///
/// # Errors
/// Fails if it has an eigenvalue below 0, apart from rounding.
fn matrix(name: &str, impedance: &Impedance) -> Result<Mat3, ErrorBody> {
    let rows = impedance.rows();
    let matrix = Mat3::from_cols_array_2d(&rows);
    if !matches!(impedance, Impedance::Matrix(_)) {
        return Ok(matrix);
    }
    let least = smallest_eigenvalue(&matrix);
    let largest = rows.as_flattened().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if least < -ROUNDING * largest {
        let message = format!("field {name:?} has the eigenvalue {least:.3}; legal: none below 0");
        return Err(ErrorBody::new(ErrorCode::BadRequest, message));
    }
    // What was rounded may have lost the eigenvalue 0. The control law allows for less rounding.
    let lift = if least < RESERVE * largest { RESERVE * largest - least.min(0.0) } else { 0.0 };
    Ok(matrix + Mat3::IDENTITY * lift)
}
