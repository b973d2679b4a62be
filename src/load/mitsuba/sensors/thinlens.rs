//! `thinlens`: a camera with depth of field. What `perspective` has but for the principal point, with `aperture_radius`
//! and `focus_distance` (`far_clip` by default), both above 0.

use super::super::parameters::ElementParameters;
use super::clip;
use super::perspective::{field_of_view, rigid_to_world};
use crate::scene::description::{CameraDescription, Lens, Projection};
use crate::scene::parameters::Parameters;

/// Reads the camera.
pub fn read(p: &mut ElementParameters) -> CameraDescription {
    let (fov, fov_axis) = field_of_view(p);
    let (near_clip, far_clip) = clip(p);
    let lens = Some(lens(p, far_clip));
    let projection = Projection::Perspective { fov, fov_axis, principal_point: [0.0; 2], lens };
    CameraDescription { to_world: rigid_to_world(p), projection, near_clip, far_clip }
}

/// The lens. Mitsuba takes a radius of 0 for a very small one and has no limits to either number.
fn lens(p: &mut ElementParameters, far_clip: f32) -> Lens {
    let aperture_radius = p.float("aperture_radius");
    match aperture_radius {
        Some(radius) if radius > 0.0 => {}
        Some(radius) => p.fault(
            "aperture_radius",
            format!("aperture_radius is {radius}; it must be above 0 (a sensor \"perspective\" has none)"),
        ),
        None if p.is_given("aperture_radius") => {} // and faulty
        None => p.fault("aperture_radius", "sensor \"thinlens\" needs the parameter \"aperture_radius\"".into()),
    }
    let focus_distance = p.float("focus_distance").unwrap_or(far_clip);
    if focus_distance <= 0.0 {
        p.fault("focus_distance", format!("focus_distance is {focus_distance}; it must be above 0"));
    }
    Lens { aperture_radius: aperture_radius.unwrap_or(1.0), focus_distance }
}
