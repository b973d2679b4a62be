//! What a scene needs, and so what can be left out.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::Appearance;
use super::description::{Integrator, Projection, SceneDescription, ShapeGeometry};
use super::lights::Light;
use super::materials::Lobes;
use super::textures::Varying;

/// What a scene uses. Dimensions, kernels and messages follow from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Kinds of materials in use, with how many of each; those of a mixture count each.
    pub materials: BTreeMap<&'static str, usize>,
    /// Some material has a lobe with a finite density.
    pub smooth_lobes: bool,
    /// Some material has delta lobes.
    pub delta_lobes: bool,
    /// Some material chooses among several lobes, which takes a primary dimension.
    pub lobe_choice: bool,
    /// Surfaces that emit.
    pub area_lights: usize,
    /// Point lights, spot lights among them.
    pub point_lights: usize,
    /// Lights from a single direction.
    pub directional_lights: usize,
    /// Lights at infinity.
    pub infinite_lights: usize,
    /// Shapes of each kind, those of groups counted once.
    pub shapes: ShapeCounts,
    /// Places of groups of shapes.
    pub instances: usize,
    /// Triangles of all meshes, those of groups counted once.
    pub triangles: usize,
    /// The camera has a lens, which takes two primary dimensions.
    pub lens: bool,
    /// Textures of materials, weights, reliefs and lights.
    pub textures: usize,
    /// Surfaces' sides that mix several materials.
    pub mixtures: usize,
    /// Surfaces' sides with bent normals.
    pub reliefs: usize,
    /// Materials that scatter differently along the surface's two directions.
    pub anisotropic: usize,
    /// Limits on path length.
    pub integrator: Integrator,
}

/// How many shapes of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShapeCounts {
    /// Meshes without shading normals.
    pub flat_meshes: usize,
    /// Meshes with shading normals.
    pub smooth_meshes: usize,
    /// Exact spheres.
    pub spheres: usize,
    /// Exact disks.
    pub disks: usize,
    /// Exact cylinders.
    pub cylinders: usize,
}

impl ShapeCounts {
    /// Those that Embree asks us about.
    pub fn quadrics(&self) -> usize {
        self.spheres + self.disks + self.cylinders
    }
}

impl Features {
    /// What that scene needs.
    pub fn of(description: &SceneDescription) -> Features {
        let mut materials = BTreeMap::new();
        let appearances = &description.appearances;
        let parts = || appearances.iter().flat_map(Appearance::parts);
        for part in parts() {
            *materials.entry(part.material.name()).or_insert(0) += 1;
        }
        let lobes = appearances.iter().map(Appearance::lobes).fold(Lobes::NONE, Lobes::or);
        let of_lights = description.shapes.iter().filter_map(|shape| match &shape.emission {
            Some(Varying::Textured(texture)) => Some(texture),
            _ => None,
        });
        let textures: BTreeSet<_> =
            appearances.iter().flat_map(Appearance::textures).chain(of_lights).map(Arc::as_ptr).collect();
        let mut shapes = ShapeCounts::default();
        let mut triangles = 0;
        for shape in description.all_shapes() {
            match &shape.geometry {
                ShapeGeometry::Mesh(mesh) => {
                    triangles += mesh.triangles.len();
                    *(if mesh.normals.is_empty() { &mut shapes.flat_meshes } else { &mut shapes.smooth_meshes }) += 1;
                }
                ShapeGeometry::Sphere { .. } => shapes.spheres += 1,
                ShapeGeometry::Disk { .. } => shapes.disks += 1,
                ShapeGeometry::Cylinder { .. } => shapes.cylinders += 1,
            }
        }
        let count = |is: fn(&Light) -> bool| description.lights.iter().filter(|l| is(l)).count();
        Features {
            materials,
            smooth_lobes: lobes.smooth,
            delta_lobes: lobes.has_delta(),
            lobe_choice: appearances.iter().any(Appearance::needs_choice),
            area_lights: description.shapes.iter().filter(|s| s.emission.is_some()).count(),
            point_lights: count(|l| matches!(l, Light::Point(_) | Light::Spot(_))),
            directional_lights: count(|l| matches!(l, Light::Directional(_))),
            infinite_lights: count(Light::is_surrounding),
            shapes,
            instances: description.instances.len(),
            triangles,
            lens: matches!(description.camera.projection, Projection::Perspective { lens: Some(_), .. }),
            textures: textures.len(),
            mixtures: appearances.iter().filter(|a| a.parts().len() > 1).count(),
            reliefs: parts().filter(|part| part.relief.is_some()).count(),
            anisotropic: parts().filter(|part| part.material.needs_tangents()).count(),
            integrator: description.integrator,
        }
    }

    /// One short phrase for each thing in use.
    pub fn in_words(&self) -> Vec<String> {
        let mut words: Vec<String> = self.materials.iter().map(|(name, n)| format!("{n} {name}")).collect();
        let shapes = &self.shapes;
        for (n, what) in [
            (self.textures, "textures"),
            (self.mixtures, "mixtures"),
            (self.reliefs, "bent normals"),
            (self.triangles, "triangles"),
            (shapes.flat_meshes, "flat meshes"),
            (shapes.smooth_meshes, "meshes with shading normals"),
            (shapes.spheres, "spheres"),
            (shapes.disks, "disks"),
            (shapes.cylinders, "cylinders"),
            (self.instances, "instances"),
            (self.area_lights, "area lights"),
            (self.point_lights, "point lights"),
            (self.directional_lights, "directional lights"),
            (self.infinite_lights, "lights at infinity"),
        ] {
            if n > 0 {
                words.push(format!("{n} {what}"));
            }
        }
        if self.lens {
            words.push("lens".to_owned());
        }
        words.push(format!("{} kernel", self.kernel().name()));
        words
    }

    /// Number of lights of all kinds.
    pub fn lights(&self) -> usize {
        self.area_lights + self.point_lights + self.directional_lights + self.infinite_lights
    }

    /// Whether choosing among lights takes a primary dimension.
    pub fn light_choice(&self) -> bool {
        self.lights() > 1
    }

    /// The kernel to run: the smallest that does all the scene needs.
    pub fn kernel(&self) -> Kernel {
        if self.beyond_diffuse().is_empty() {
            Kernel::Diffuse
        } else if self.beyond_flat().is_empty() {
            Kernel::Flat
        } else if self.beyond_plain().is_empty() {
            Kernel::Plain
        } else {
            Kernel::Full
        }
    }

    /// What the scene needs and [`Kernel::Plain`] cannot do, one short phrase each.
    pub fn beyond_plain(&self) -> Vec<String> {
        let needs = [
            (self.textures, "textures"),
            (self.mixtures, "mixtures of materials"),
            (self.reliefs, "bent normals"),
            (self.anisotropic, "anisotropic materials"),
        ];
        needs.into_iter().filter(|(n, _)| *n > 0).map(|(_, name)| name.to_owned()).collect()
    }

    /// What the scene needs and [`Kernel::Diffuse`] cannot do, one short phrase each.
    pub fn beyond_diffuse(&self) -> Vec<String> {
        let materials =
            self.materials.keys().filter(|name| **name != "diffuse").map(|name| format!("{name} materials"));
        materials.chain(self.beyond_flat()).collect()
    }

    /// What the scene needs and [`Kernel::Flat`] cannot do, one short phrase each.
    pub fn beyond_flat(&self) -> Vec<String> {
        let others = [
            (self.shapes.smooth_meshes, "shading normals"),
            (self.shapes.spheres, "spheres"),
            (self.shapes.disks, "disks"),
            (self.shapes.cylinders, "cylinders"),
            (self.instances, "instances"),
            (self.point_lights, "point lights"),
            (self.directional_lights, "directional lights"),
            (self.infinite_lights, "lights at infinity"),
        ];
        let others = others.into_iter().filter(|(n, _)| *n > 0).map(|(_, name)| name.to_owned());
        others.chain(self.beyond_plain()).collect()
    }
}

/// The closed list of kernels, smallest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kernel {
    /// Diffuse materials on flat meshes, lit by meshes.
    Diffuse,
    /// All materials, each the same everywhere, on flat meshes, lit by meshes.
    Flat,
    /// All materials, shapes and lights, each the same everywhere.
    Plain,
    /// Everything.
    Full,
}

impl Kernel {
    /// Its name in messages and logs.
    pub fn name(self) -> &'static str {
        match self {
            Kernel::Diffuse => "diffuse",
            Kernel::Flat => "flat",
            Kernel::Plain => "plain",
            Kernel::Full => "full",
        }
    }
}

/// What a kernel may take for granted, known at compile time.
pub trait Profile {
    /// All materials are diffuse.
    const DIFFUSE: bool;
    /// All shapes are triangle meshes without shading normals, so are all lights, and there are no instances.
    const FLAT_MESHES: bool;
    /// Surfaces may vary from place to place: textures, mixtures, bent normals, tangents that matter.
    const VARYING: bool;
}

/// The profile of [`Kernel::Diffuse`].
pub enum DiffuseProfile {}

/// The profile of [`Kernel::Flat`].
pub enum FlatProfile {}

/// The profile of [`Kernel::Plain`].
pub enum PlainProfile {}

/// The profile of [`Kernel::Full`].
pub enum FullProfile {}

impl Profile for DiffuseProfile {
    const DIFFUSE: bool = true;
    const FLAT_MESHES: bool = true;
    const VARYING: bool = false;
}

impl Profile for FlatProfile {
    const DIFFUSE: bool = false;
    const FLAT_MESHES: bool = true;
    const VARYING: bool = false;
}

impl Profile for PlainProfile {
    const DIFFUSE: bool = false;
    const FLAT_MESHES: bool = false;
    const VARYING: bool = false;
}

impl Profile for FullProfile {
    const DIFFUSE: bool = false;
    const FLAT_MESHES: bool = false;
    const VARYING: bool = true;
}
