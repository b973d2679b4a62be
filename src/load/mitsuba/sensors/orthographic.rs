//! `orthographic`: parallel rays. `to_world`, whose scale is that of the picture (which is 2 wide without), `near_clip`,
//! `far_clip`.

use super::super::parameters::ElementParameters;
use super::clip;
use crate::scene::description::{CameraDescription, Projection};
use crate::scene::parameters::Parameters;

/// Reads the camera.
pub fn read(p: &mut ElementParameters) -> CameraDescription {
    let (near_clip, far_clip) = clip(p);
    p.float("focus_distance"); // means nothing, as in Mitsuba
    CameraDescription { to_world: p.to_world(), projection: Projection::Orthographic, near_clip, far_clip }
}
