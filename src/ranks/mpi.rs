//! Ranks that `mpirun` has started.

use mpi::{
    Threading,
    datatype::PartitionMut,
    environment::Universe,
    topology::SimpleCommunicator,
    traits::{Communicator, CommunicatorCollectives, Destination, Root, Source},
};

use super::Ranks;

/// Bytes of one message at most: MPI counts in 32 bits with a sign.
const PIECE: usize = 1 << 30;

/// All processes of an MPI job.
pub struct World {
    number: usize,
    count: usize,
    /// Ends MPI when it goes.
    _universe: Universe,
}

impl World {
    /// Enters MPI; nothing for a process that is alone.
    pub fn start() -> Option<World> {
        // threads of a pool talk, one at a time
        let (universe, threading) = mpi::initialize_with_threading(Threading::Serialized)?;
        let world = universe.world();
        let (number, count) = (world.rank() as usize, world.size() as usize);
        assert!(threading >= Threading::Serialized || count == 1, "this MPI lets only the first thread talk");
        (count > 1).then_some(World { number, count, _universe: universe })
    }
}

/// The end of MPI waits for all ranks: one that panics would wait for ever for those who wait for it.
impl Drop for World {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.abort(101);
        }
    }
}

/// The same for every thread.
fn world() -> SimpleCommunicator {
    SimpleCommunicator::world()
}

impl Ranks for World {
    fn number(&self) -> usize {
        self.number
    }

    fn count(&self) -> usize {
        self.count
    }

    fn send(&self, to: usize, bytes: &[u8]) {
        let world = world();
        let to = world.process_at_rank(to as i32);
        to.send(&(bytes.len() as u64));
        bytes.chunks(PIECE).for_each(|piece| to.send(piece));
    }

    fn receive(&self, from: usize) -> Vec<u8> {
        let world = world();
        let from = world.process_at_rank(from as i32);
        let (length, _) = from.receive::<u64>();
        let mut bytes = vec![0; length as usize];
        for piece in bytes.chunks_mut(PIECE) {
            from.receive_into(piece);
        }
        bytes
    }

    fn everywhere(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let world = world();
        // never empty: a vector of nothing points to address 1, by which MPI means that there is nothing to send
        let own = [own, &[0]].concat();
        let mut lengths = vec![0u64; self.count];
        world.all_gather_into(&(own.len() as u64), &mut lengths[..]);
        let all: u64 = lengths.iter().sum();
        assert!(all < i32::MAX as u64, "{all} bytes of statistics are more than MPI counts");
        let counts: Vec<i32> = lengths.iter().map(|length| *length as i32).collect();
        let places: Vec<i32> =
            counts.iter().scan(0, |place, count| Some(std::mem::replace(place, *place + count))).collect();
        let mut bytes = vec![0u8; all as usize];
        world.all_gather_varcount_into(&own[..], &mut PartitionMut::new(&mut bytes[..], counts, places));
        let mut rest = &bytes[..];
        let one = |length: &u64| {
            let bytes = rest.split_off(..*length as usize).expect("a sum of lengths");
            bytes[..bytes.len() - 1].to_vec()
        };
        lengths.iter().map(one).collect()
    }

    fn of_first(&self, own: Vec<u8>) -> Vec<u8> {
        let world = world();
        let first = world.process_at_rank(0);
        let mut length = own.len() as u64;
        first.broadcast_into(&mut length);
        let mut bytes = if self.number == 0 { own } else { vec![0; length as usize] };
        bytes.chunks_mut(PIECE).for_each(|piece| first.broadcast_into(piece));
        bytes
    }

    fn abort(&self, code: i32) -> ! {
        world().abort(code)
    }
}
