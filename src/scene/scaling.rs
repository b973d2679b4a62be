//! Scenes in another unit of length.
//!
//! Radiance does not depend on the unit, but absolute lengths do occur: rays start off surfaces by 2⁻¹⁶ where coordinates
//! are near zero (see [`offset_origin`](crate::math::offset_origin)), which is the size of a whole scene that is 10⁻⁵
//! large. Such scenes are therefore made as large as the others before anything is built of them, by a power of two, so
//! that no number is rounded: what is small looks bit by bit like what is larger.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3};

use super::{
    SceneDescription,
    description::{InstanceDescription, Lens, Projection, ShapeDescription, ShapeGeometry},
    lights::Light,
};

/// Largest coordinate of a scene below which it is enlarged; up to there 2⁻¹⁶ is a 16,000th of it at most.
const SMALL: f32 = 0.25;

impl SceneDescription {
    /// The scene in units in which lengths are numbers that the renderer is made for: itself, or enlarged by a power of
    /// two so that its largest coordinate is in [1, 2).
    ///
    /// Large ones stay as they are: small things on wide ground would become too small.
    pub fn in_fit_units(self) -> SceneDescription {
        let largest = self.largest_coordinate();
        if !(largest > f32::MIN_POSITIVE && largest < SMALL) {
            return self;
        }
        let exponent = (largest.to_bits() >> (f32::MANTISSA_DIGITS - 1)) as i32 - (f32::MAX_EXP - 1);
        self.scaled(2f32.powi(-exponent))
    }

    /// Largest magnitude of a coordinate of anything that has a place: surfaces, the camera, lights.
    fn largest_coordinate(&self) -> f32 {
        let of_shapes = self.shapes.iter().map(|shape| reach(&shape.geometry));
        let of_instances = self.instances.iter().map(|instance| {
            let shapes = &self.groups[instance.group].shapes;
            let own = shapes.iter().map(|shape| reach(&shape.geometry)).fold(Vec3::ZERO, Vec3::max);
            let m = instance.to_world.matrix3;
            let linear = Mat3A::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
            linear.mul_vec3(own) + Vec3::from(instance.to_world.translation).abs()
        });
        let of_lights = self.lights.iter().filter_map(Light::position).map(Vec3::abs);
        let camera = Vec3::from(self.camera.to_world.translation).abs();
        of_shapes.chain(of_instances).chain(of_lights).fold(camera, Vec3::max).max_element()
    }

    /// The same scene in a unit of length that is `1/factor` times as large, so that all lengths are `factor` times what
    /// they were, and the image is the same. Exact for powers of two.
    pub fn scaled(mut self, factor: f32) -> SceneDescription {
        let about_origin = |to_world: &Affine3A| Affine3A {
            matrix3: to_world.matrix3 * factor,
            translation: to_world.translation * factor,
        };
        let camera = &mut self.camera;
        match &mut camera.projection {
            Projection::Perspective { lens, .. } => {
                // what is in front of the eye is in units of the world, whatever the scale of its own coordinates
                camera.to_world.translation *= factor;
                camera.near_clip *= factor;
                camera.far_clip = (camera.far_clip * factor).min(f32::MAX);
                if let Some(Lens { aperture_radius, focus_distance }) = lens {
                    *aperture_radius *= factor;
                    *focus_distance *= factor;
                }
            }
            Projection::Orthographic => {
                camera.to_world = about_origin(&camera.to_world);
                let depth = (camera.far_clip - camera.near_clip) * factor;
                camera.far_clip = (camera.near_clip + depth).min(f32::MAX);
            }
        }
        self.shapes.iter_mut().for_each(|shape| scale_shape(shape, factor));
        for InstanceDescription { to_world, .. } in &mut self.instances {
            *to_world = about_origin(to_world);
        }
        self.lights.iter_mut().for_each(|light| light.scale(factor));
        self.appearances.iter_mut().for_each(|appearance| appearance.scale_heights(factor));
        self
    }
}

/// Bound of the magnitudes of coordinates.
fn reach(geometry: &ShapeGeometry) -> Vec3 {
    match geometry {
        ShapeGeometry::Mesh(mesh) => mesh.positions().iter().fold(Vec3::ZERO, |most, p| most.max(p.abs())),
        ShapeGeometry::Sphere { center, radius, .. } | ShapeGeometry::Disk { center, radius, .. } => {
            center.abs() + *radius
        }
        ShapeGeometry::Cylinder { start, length, radius, .. } => start.abs() + (length + radius),
    }
}

fn scale_shape(shape: &mut ShapeDescription, factor: f32) {
    match &mut shape.geometry {
        ShapeGeometry::Mesh(mesh) => Arc::make_mut(mesh).scale(factor),
        ShapeGeometry::Sphere { center, radius, .. } | ShapeGeometry::Disk { center, radius, .. } => {
            *center *= factor;
            *radius *= factor;
        }
        ShapeGeometry::Cylinder { start, length, radius, .. } => {
            *start *= factor;
            *length *= factor;
            *radius *= factor;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::load;

    fn described(elements: &str) -> SceneDescription {
        load::text(Path::new("a.xml"), format!("<scene version='3.0.0'>{elements}</scene>")).unwrap()
    }

    /// Something of every kind that has a place, in size `unit`.
    fn everything(unit: f32) -> SceneDescription {
        described(&format!(
            "<sensor type='thinlens'><float name='aperture_radius' value='{a}'/><float name='focus_distance' value='{b}'/>
               <float name='near_clip' value='{a}'/><float name='far_clip' value='{c}'/>
               <transform name='to_world'><translate x='{b}'/></transform><film type='hdrfilm'/></sensor>
             <shape type='rectangle'><transform name='to_world'><scale value='{b}'/></transform></shape>
             <shape type='sphere'><point name='center' value='{a}, 0, {b}'/><float name='radius' value='{a}'/></shape>
             <shape type='disk'><transform name='to_world'><scale value='{a}'/></transform></shape>
             <shape type='cylinder'><point name='p0' value='0, 0, {a}'/><point name='p1' value='0, 0, {c}'/>
               <float name='radius' value='{a}'/></shape>
             <shape type='shapegroup' id='g'><shape type='sphere'/></shape>
             <shape type='instance'><ref id='g'/><transform name='to_world'><scale value='{b}'/><translate y='{c}'/>
               </transform></shape>
             <emitter type='point'><point name='position' value='{a}, {b}, {c}'/>
               <rgb name='intensity' value='{square}'/></emitter>
             <emitter type='spot'><transform name='to_world'><translate z='{c}'/></transform>
               <rgb name='intensity' value='{square}'/></emitter>
             <emitter type='directional'/>",
            a = unit,
            b = 2.0 * unit,
            c = 8.0 * unit,
            square = unit * unit
        ))
    }

    #[test]
    fn all_lengths_are_scaled() {
        let (scaled, made) = (everything(1.0).scaled(1.0 / 1024.0), everything(1.0 / 1024.0));
        assert_eq!(format!("{scaled:?}"), format!("{made:?}"));
    }

    #[test]
    fn parallel_rays_go_as_far_in_their_unit() {
        let elements = |unit: f32| {
            described(&format!(
                "<sensor type='orthographic'><transform name='to_world'><scale value='{unit}'/></transform>
                   <float name='near_clip' value='0.5'/><float name='far_clip' value='{}'/><film type='hdrfilm'/></sensor>
                 <emitter type='constant'/>",
                0.5 + 4.0 * unit
            ))
        };
        let (scaled, made) = (elements(1.0).scaled(0.125), elements(0.125));
        assert_eq!(format!("{:?}", scaled.camera), format!("{:?}", made.camera));
    }

    #[test]
    fn small_scenes_become_as_large_as_others_and_large_ones_stay() {
        for (unit, largest) in [(1e-6, 8.0 * 8.0), (1e-3, 8.0), (1.0, 9.0 + 1.0), (1e5, 1e6)] {
            let before = everything(unit).largest_coordinate();
            let after = everything(unit).in_fit_units().largest_coordinate();
            assert!(after <= f32::max(largest, before), "{unit}: {after}");
            assert!(
                if before < SMALL { (1.0..2.0).contains(&after) } else { after == before },
                "{unit}: {before}, {after}"
            );
        }
    }
}
