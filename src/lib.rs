//! relt renders images by replica-exchange light transport.
//!
//! Many Metropolis chains walk the unit cube of primary samples on ladders of inverse temperatures, from the
//! uniform distribution (β = 0, plain path tracing) to the scene's luminance (β = 1); neighbours on a ladder
//! exchange states. One progressive pass gives the image and its normalisation.
//!
//! The life of one mutation runs through the modules in this order: [`sample`] proposes a point, [`path`] maps
//! it to a light path whose rays [`embree`] traces through the [`scene`], [`chain`] accepts or rejects it,
//! [`tempering`] swaps it along its ladder, [`film`] gathers its splats, and [`render`] repeats that until the
//! budget is spent. [`load`] makes scenes from files and [`cli`] jobs from command lines; [`convert`] makes such files
//! of other renderers' scenes; [`study`] draws what runs leave behind; [`batch`] keeps queues of them; [`stress`] checks all of it at the ends of what
//! numbers can be.
//!
//! ```standalone_crate
//! use std::{path::Path, sync::atomic::AtomicBool};
//!
//! use relt::{embree, load, render, scene::Scene};
//!
//! let path = Path::new("scenes/cornell-box/scene.xml");
//! let description = load::scene(path, &[("res".into(), "16".into())])?;
//! let scene = Scene::new(&embree::Device::new("")?, description)?;
//!
//! let settings = render::Settings { mutations_per_pixel: Some(4.0), ..Default::default() };
//! let job = render::Job { scene: &scene, scene_name: "box".into(), settings, stop: &AtomicBool::new(false) };
//! let outcome = render::run(&job, &())?; // `()` observes nothing
//! assert!(outcome.picture.image.mean().iter().all(|channel| *channel > 0.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod batch;
pub mod chain;
pub mod checksum;
pub mod cli;
pub mod convert;
pub mod embree;
pub mod film;
pub mod load;
pub mod math;
pub(crate) mod memory;
pub mod path;
pub mod ranks;
pub mod render;
pub mod rng;
pub mod sample;
pub mod saved;
pub mod scene;
pub mod stress;
pub mod study;
pub mod tempering;
