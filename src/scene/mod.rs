//! The immutable scene: shapes, materials, lights, camera.

pub mod description;
pub mod lights;
pub mod materials;
pub mod mesh;
pub mod parameters;

pub use description::SceneDescription;
pub use mesh::Mesh;

/// A colour or a radiometric quantity in linear RGB (Rec. 709 primaries), one `f32` a channel.
pub type Rgb = glam::Vec3;
