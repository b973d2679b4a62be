//! Scenes that are open: each read once for all its jobs, and kept until the last of them is over.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use super::super::failure::Failure;
use super::super::scene::{Opened, SceneArguments};
use super::jobs::BatchJob;
use crate::render::checkpoint;

/// A scene file with its definitions.
type Key = (PathBuf, Vec<(String, String)>);

/// A scene that is ready.
pub(super) struct Loaded {
    pub opened: Opened,
    /// Its number in checkpoints; empty where nobody wants it.
    pub digest: String,
}

/// A scene, or what is wrong with it.
type Slot = Arc<OnceLock<Result<Arc<Loaded>, String>>>;

/// All scenes of a batch.
pub(super) struct Scenes {
    /// Those with jobs left, and how many.
    slots: Mutex<BTreeMap<Key, (Slot, usize)>>,
    /// Some job leaves a checkpoint, which tells its scene from others.
    kept: bool,
}

impl Scenes {
    /// For these jobs.
    pub fn new<'a>(jobs: impl Iterator<Item = &'a BatchJob>) -> Scenes {
        let (mut slots, mut kept) = (BTreeMap::<Key, (Slot, usize)>::new(), false);
        for job in jobs {
            slots.entry(key(job)).or_default().1 += 1;
            kept |= job.keep.is_some();
        }
        Scenes { slots: Mutex::new(slots), kept }
    }

    /// The scene of a job, which is read now or was before; a second one who wants it waits for the first.
    pub fn of(&self, job: &BatchJob, arguments: &SceneArguments) -> Result<Arc<Loaded>, Failure> {
        let slot = self.locked().get(&key(job)).expect("the job is one of the batch and not over").0.clone();
        let load = || self.load(job, arguments).map(Arc::new).map_err(|failure| failure.plain());
        slot.get_or_init(load).clone().map_err(Failure::running)
    }

    fn load(&self, job: &BatchJob, arguments: &SceneArguments) -> Result<Loaded, Failure> {
        let description = arguments.describe(job.settings.threads, true)?;
        let digest = if self.kept { checkpoint::scene_digest(&description) } else { String::new() };
        Ok(Loaded { opened: Opened::of(description, job.settings.threads, true)?, digest })
    }

    /// The job is over; a scene without further jobs goes.
    pub fn release(&self, job: &BatchJob) {
        let mut slots = self.locked();
        let key = key(job);
        if let Some((_, left)) = slots.get_mut(&key) {
            *left -= 1;
            if *left == 0 {
                slots.remove(&key);
            }
        }
    }

    fn locked(&self) -> MutexGuard<'_, BTreeMap<Key, (Slot, usize)>> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn key(job: &BatchJob) -> Key {
    (job.entry.scene.clone(), job.entry.defines.clone())
}
