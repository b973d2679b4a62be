//! `perspective`: a pinhole camera with `to_world`, `fov` and `fov_axis` or `focal_length`, `principal_point_offset_x`
//! and `_y`, `near_clip`, `far_clip`. A `focus_distance` is accepted and means nothing, as in Mitsuba: everything is sharp.

use glam::{Affine3A, Mat3A};

use super::super::parameters::ElementParameters;
use super::super::values;
use super::clip;
use crate::scene::description::{CameraDescription, FovAxis, Projection};
use crate::scene::parameters::Parameters;

const AXES: &[(&str, FovAxis)] = &[
    ("x", FovAxis::X),
    ("y", FovAxis::Y),
    ("diagonal", FovAxis::Diagonal),
    ("smaller", FovAxis::Smaller),
    ("larger", FovAxis::Larger),
];

/// Diagonal of the 36 × 24 mm picture of 35 mm film, to which focal lengths refer.
const DIAGONAL_MM: f32 = 43.266_61;

/// Offsets of the principal point beyond which single precision tells pixels apart no longer.
const MAX_OFFSET: f32 = 100.0;

/// Largest entry of MᵀM − 1 that is not a scale; covers matrices written with four digits.
const SCALE_TOLERANCE: f32 = 1e-3;

/// Reads the camera.
pub fn read(p: &mut ElementParameters) -> CameraDescription {
    let (fov, fov_axis) = field_of_view(p);
    let (near_clip, far_clip) = clip(p);
    p.float("focus_distance");
    let projection = Projection::Perspective { fov, fov_axis, principal_point: principal_point(p), lens: None };
    CameraDescription { to_world: rigid_to_world(p), projection, near_clip, far_clip }
}

/// `fov` in degrees along `fov_axis`, or else the diagonal one of `focal_length`, 50 mm by default.
pub(super) fn field_of_view(p: &mut ElementParameters) -> (f32, FovAxis) {
    let fov = p.float("fov");
    let focal_length = p.string("focal_length");
    let axis = p.choice("fov_axis", AXES, FovAxis::X);
    match (fov, focal_length) {
        (Some(fov), None) if fov > 0.0 && fov < 180.0 => return (fov, axis),
        (Some(fov), None) => p.fault("fov", format!("fov is {fov} degrees; it must lie between 0 and 180")),
        (Some(_), Some(_)) => p.fault("focal_length", "both fov and focal_length are given; one is accepted".into()),
        (None, length) => return (of_focal_length(p, length.as_deref().unwrap_or("50mm")), FovAxis::Diagonal),
    }
    (90.0, axis)
}

/// Diagonal field of view of a focal length such as `50mm`.
fn of_focal_length(p: &mut ElementParameters, text: &str) -> f32 {
    match values::float(text.trim().strip_suffix("mm").unwrap_or(text)) {
        Ok(length) if length > 0.0 => return 2.0 * (DIAGONAL_MM / (2.0 * length)).atan().to_degrees(),
        Ok(length) => p.fault("focal_length", format!("focal_length is {length} mm; it must be above 0")),
        Err(message) => p.fault("focal_length", message),
    }
    90.0
}

/// `principal_point_offset_x` and `_y`, fractions of the picture's width and height.
fn principal_point(p: &mut ElementParameters) -> [f32; 2] {
    ["principal_point_offset_x", "principal_point_offset_y"].map(|name| {
        let given = p.float(name).unwrap_or(0.0);
        if given.abs() <= MAX_OFFSET {
            return given;
        }
        p.fault(name, format!("{name} is {given} times the picture; accepted: -{MAX_OFFSET} to {MAX_OFFSET}"));
        0.0
    })
}

/// `to_world`, which may turn, move and mirror but not scale.
pub(super) fn rigid_to_world(p: &mut ElementParameters) -> Affine3A {
    let to_world = p.to_world();
    let m = to_world.matrix3;
    let error = m.transpose() * m + Mat3A::IDENTITY * -1.0;
    if error.to_cols_array().iter().any(|entry| entry.abs() > SCALE_TOLERANCE) {
        p.fault("to_world", "the transform of a sensor must not scale or shear".into());
    }
    to_world
}
