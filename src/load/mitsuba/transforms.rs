//! `<transform>`: steps that apply one after the other, each in the coordinates that the ones before it made.

use glam::{Affine3A, DAffine3, DMat3, DVec3};

use super::document::Element;
use super::values;
use crate::load::faults::Faults;

/// Largest deviation of a rotation axis from unit length; covers axes written with three digits.
const AXIS_TOLERANCE: f64 = 1e-2;

/// |det| over the product of the columns' lengths below which a transform counts as singular: single precision
/// would make nothing of it.
const SINGULAR: f64 = 1e-9;

/// The transform of an element's steps, first one applied first.
pub fn read(element: &Element, faults: &Faults) -> Option<Affine3A> {
    let mut whole = Some(DAffine3::IDENTITY);
    for step in &element.children {
        // All steps are read even after a faulty one, to report all of them.
        whole = self::step(step, faults).zip(whole).map(|(step, whole)| step * whole);
    }
    let whole = whole?;
    let columns = whole.matrix3;
    let volume = columns.x_axis.length() * columns.y_axis.length() * columns.z_axis.length();
    let is_singular = columns.determinant().abs() <= SINGULAR * volume;
    let single = Affine3A::from_mat3_translation(columns.as_mat3(), whole.translation.as_vec3());
    if is_singular || !single.is_finite() || !single.inverse().is_finite() {
        faults.at(&element.span, "the transform is singular: it flattens space or makes values infinite");
        return None;
    }
    Some(single)
}

/// One step as an affine map.
fn step(step: &Element, faults: &Faults) -> Option<DAffine3> {
    match step.tag {
        "translate" => values::xyz(step, Some(0.0), faults).map(DAffine3::from_translation),
        "scale" => values::xyz(step, Some(1.0), faults).map(DAffine3::from_scale),
        "rotate" => rotate(step, faults),
        "lookat" => look_at(step, faults),
        "matrix" => matrix(step, faults),
        other => unreachable!("<{other}> is not a step of a transform"),
    }
}

/// A rotation by `angle` degrees, counter-clockwise seen against the axis.
///
/// Mitsuba does not normalise the axis, which scales space by its length squared; so another length is a fault.
fn rotate(step: &Element, faults: &Faults) -> Option<DAffine3> {
    let axis = values::xyz(step, Some(0.0), faults);
    let angle = step.attribute("angle")?;
    let degrees = values::number(&angle.value).map_err(|message| faults.at(&angle.span, message)).ok();
    let (axis, degrees) = axis.zip(degrees)?;
    match axis.try_normalize() {
        None => faults.at(&step.span, "the rotation axis has no length; give x, y or z"),
        Some(unit) if (axis.length() - 1.0).abs() > AXIS_TOLERANCE => {
            let message =
                format!("the rotation axis must have length 1, as in {:.6} {:.6} {:.6}", unit.x, unit.y, unit.z);
            faults.at(&step.span, message);
        }
        Some(unit) => return Some(DAffine3::from_axis_angle(unit, degrees.to_radians())),
    }
    None
}

/// A camera's place: +z towards the target, +x to the left, +y as near to `up` as can be.
fn look_at(step: &Element, faults: &Faults) -> Option<DAffine3> {
    let vector = |name: &str| {
        let attribute = step.attribute(name)?;
        values::vector(&attribute.value).map_err(|message| faults.at(&attribute.span, message)).ok()
    };
    let up = vector("up");
    let (origin, target) = vector("origin").zip(vector("target"))?;
    if up.is_none() && step.attribute("up").is_some() {
        return None;
    }
    let Some(forward) = (target - origin).try_normalize() else {
        faults.at(step.span_of("target"), "the target of <lookat> is its origin");
        return None;
    };
    // Without `up` Mitsuba takes any direction across, this one (Duff et al. 2017), as does glam.
    let up = up.unwrap_or_else(|| forward.any_orthonormal_pair().0);
    let left = up.cross(forward);
    if left.length() <= SINGULAR * up.length() {
        faults.at(step.span_of("up"), "up is parallel to the direction of <lookat>, or has no length");
        return None;
    }
    let left = left.normalize();
    let matrix = DMat3::from_cols(left, forward.cross(left), forward);
    Some(DAffine3::from_mat3_translation(matrix, origin))
}

/// Nine or sixteen numbers, row by row.
fn matrix(step: &Element, faults: &Faults) -> Option<DAffine3> {
    let attribute = step.attribute("value")?;
    let fault = |message: String| faults.at(&attribute.span, message);
    let m = values::numbers(&attribute.value).map_err(fault).ok()?;
    let row = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
    let rows = |stride: usize| DMat3::from_cols(row(0), row(stride), row(2 * stride)).transpose();
    match m.len() {
        9 => Some(DAffine3::from_mat3(rows(3))),
        16 if m[12..] == [0.0, 0.0, 0.0, 1.0] => {
            Some(DAffine3::from_mat3_translation(rows(4), DVec3::new(m[3], m[7], m[11])))
        }
        16 => {
            fault(format!("the last row of the matrix is {:?}; only 0 0 0 1 is supported", &m[12..]));
            None
        }
        count => {
            fault(format!("the matrix has {count} numbers; expected 9 or 16"));
            None
        }
    }
}
