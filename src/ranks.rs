//! Processes that work on one run together: what they tell one another.
//!
//! All of it goes through [`Ranks`]: MPI's with the feature `mpi`, threads of one process in tests. A run on ranks has the
//! bits of the run without them because nothing that is told depends on when it is told: sums are integers, and what is
//! not is put together by number and never in the order in which it came.

#[cfg(feature = "mpi")]
mod mpi;

use std::ops::Range;
use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering::Relaxed},
};
use std::time::{Duration, Instant};

use serde::{Serialize, de::DeserializeOwned};

use crate::{film::Accumulator, saved::Source};

/// A way for ranks to reach one another. All ranks make the same calls in the same order.
pub trait Ranks: Send + Sync {
    /// Number of this rank, from 0.
    fn number(&self) -> usize;
    /// How many there are.
    fn count(&self) -> usize;
    /// Hands bytes to another rank.
    fn send(&self, to: usize, bytes: &[u8]);
    /// Waits for bytes of another rank.
    fn receive(&self, from: usize) -> Vec<u8>;
    /// Everyone's bytes for everyone, by rank.
    fn everywhere(&self, own: &[u8]) -> Vec<Vec<u8>>;
    /// The first rank's bytes for everyone; what others have is not looked at.
    fn of_first(&self, own: Vec<u8>) -> Vec<u8>;
    /// Ends all of them at once with that exit code: others may be waiting for what this one can no longer say.
    fn abort(&self, code: i32) -> !;
}

/// How many processes `mpirun` or `srun` has started for one run with this one, if this program has no way to talk to them.
pub fn out_of_reach() -> Option<u32> {
    let count = |name: &&str| std::env::var(name).ok()?.parse().ok();
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"].iter().find_map(count).filter(|count| *count > 1 && !cfg!(feature = "mpi"))
}

/// Ranks, and what it takes to talk to them.
pub struct Company {
    ranks: Box<dyn Ranks>,
    nanoseconds: AtomicU64,
    bytes: AtomicU64,
    messages: AtomicU64,
}

/// What talking has taken so far, of one rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Talk {
    /// Wall time, in which this rank mostly waited for slower ones.
    pub time: Duration,
    /// Bytes that came from others.
    pub bytes: u64,
    /// Exchanges that this rank took part in.
    pub messages: u64,
}

impl Company {
    /// Of those ranks.
    pub fn new(ranks: Box<dyn Ranks>) -> Arc<Company> {
        let [nanoseconds, bytes, messages] = [(); 3].map(|()| AtomicU64::new(0));
        Arc::new(Company { ranks, nanoseconds, bytes, messages })
    }

    /// The processes that `mpirun` has started with this one; nothing for one alone, and without the feature `mpi`.
    pub fn of_processes() -> Option<Arc<Company>> {
        #[cfg(feature = "mpi")]
        return mpi::World::start().map(|world| Company::new(Box::new(world)));
        #[cfg(not(feature = "mpi"))]
        None
    }

    /// Number of this rank, from 0.
    pub fn number(&self) -> usize {
        self.ranks.number()
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.ranks.count()
    }

    /// Ends all of them at once with that exit code.
    pub fn abort(&self, code: i32) -> ! {
        self.ranks.abort(code)
    }

    /// Whether this is the one that learns, writes and talks to people.
    pub fn is_first(&self) -> bool {
        self.number() == 0
    }

    /// Of so many pieces of work those of this rank: some each, or one that several ranks have where these are more.
    pub fn own(&self, pieces: usize) -> Range<usize> {
        self.pieces_of(self.number(), pieces)
    }

    /// The ranks that have a piece; all ranks of a piece that several have have no other.
    pub fn ranks_at(&self, piece: usize, pieces: usize) -> Range<usize> {
        let has_it = |rank: &usize| self.pieces_of(*rank, pieces).contains(&piece);
        let first = (0..self.count()).find(has_it).expect("every piece is somebody's");
        first..(first..self.count()).take_while(has_it).last().map_or(first, |last| last + 1)
    }

    fn pieces_of(&self, rank: usize, pieces: usize) -> Range<usize> {
        let first = |rank: usize| pieces * rank / self.count();
        first(rank)..first(rank + 1).max(first(rank) + 1)
    }

    /// This rank among those that have the same piece.
    pub fn group(self: &Arc<Self>, piece: usize, pieces: usize) -> Group {
        let ranks = self.ranks_at(piece, pieces);
        Group { company: Some(self.clone()), number: self.number() - ranks.start, ranks }
    }

    /// Everyone's value for everyone, by rank.
    pub fn everywhere<T: Serialize + DeserializeOwned>(&self, own: &T) -> Vec<T> {
        let own = to_bytes(own);
        let all = self.timed(|ranks| ranks.everywhere(&own), |all| all.iter().map(Vec::len).sum::<usize>() - own.len());
        all.iter().map(|bytes| from_bytes(bytes)).collect()
    }

    /// The first rank's value for everyone; others need none.
    pub fn of_first<T: Serialize + DeserializeOwned>(&self, own: Option<&T>) -> T {
        let own = own.map_or_else(Vec::new, to_bytes);
        from_bytes(&self.timed(|ranks| ranks.of_first(own), Vec::len))
    }

    /// The first rank's bytes for everyone.
    pub fn bytes_of_first(&self, own: Vec<u8>) -> Vec<u8> {
        self.timed(|ranks| ranks.of_first(own), Vec::len)
    }

    /// Brings together at the first rank what all have, over log₂ of their number steps: `save` gives this rank's bytes, with
    /// what was `add`ed to them before. Only for what may be added in any order.
    pub fn fold<S>(&self, state: &mut S, save: impl Fn(&S) -> Vec<u8>, mut add: impl FnMut(&mut S, &[u8])) {
        let (number, count) = (self.number(), self.count());
        let mut step = 1;
        while step < count {
            if number % (2 * step) == step {
                let bytes = save(state);
                return self.timed(|ranks| ranks.send(number - step, &bytes), |()| 0);
            }
            if number + step < count {
                let bytes = self.timed(|ranks| ranks.receive(number + step), Vec::len);
                add(state, &bytes);
            }
            step *= 2;
        }
    }

    /// Adds up films at the first rank; the others begin with an `empty` one again.
    pub fn gather_film(&self, film: &mut Accumulator, empty: impl Fn() -> Accumulator) {
        let save = |film: &&mut Accumulator| {
            let mut bytes = Vec::new();
            film.save(&mut bytes).expect("memory takes all");
            bytes
        };
        let add = |film: &mut &mut Accumulator, bytes: &[u8]| {
            let mut other = empty();
            other.restore(&mut Source::new(bytes, bytes.len() as u64)).expect("what a rank of the same run told");
            film.merge(&other);
        };
        self.fold(&mut &mut *film, save, add);
        if !self.is_first() {
            *film = empty();
        }
    }

    /// What talking has taken so far.
    pub fn talk(&self) -> Talk {
        Talk {
            time: Duration::from_nanos(self.nanoseconds.load(Relaxed)),
            bytes: self.bytes.load(Relaxed),
            messages: self.messages.load(Relaxed),
        }
    }

    fn timed<T>(&self, talk: impl FnOnce(&dyn Ranks) -> T, bytes: impl FnOnce(&T) -> usize) -> T {
        let begin = Instant::now();
        let heard = talk(self.ranks.as_ref());
        self.nanoseconds.fetch_add(begin.elapsed().as_nanos() as u64, Relaxed);
        self.bytes.fetch_add(bytes(&heard) as u64, Relaxed);
        self.messages.fetch_add(1, Relaxed);
        heard
    }
}

/// Ranks that share a piece of work, or one alone.
#[derive(Clone)]
pub struct Group {
    company: Option<Arc<Company>>,
    ranks: Range<usize>,
    /// Number of this rank among them.
    number: usize,
}

impl Group {
    /// This rank, which shares with nobody.
    pub fn alone() -> Group {
        Group { company: None, ranks: 0..1, number: 0 }
    }

    /// How many they are.
    pub fn count(&self) -> usize {
        self.ranks.len()
    }

    /// Whether there is nobody to share with.
    pub fn is_alone(&self) -> bool {
        self.count() == 1
    }

    /// Whether this is the first of them, which keeps what they have in common.
    pub fn is_first(&self) -> bool {
        self.number == 0
    }

    /// Of so many things those of this rank; ranks have theirs in the order of their numbers.
    pub fn own(&self, things: usize) -> Range<usize> {
        self.of(self.number, things)
    }

    /// The same of number `number` among them.
    pub fn of(&self, number: usize, things: usize) -> Range<usize> {
        let first = |number: usize| things * number / self.ranks.len();
        first(number)..first(number + 1)
    }

    /// Everyone's value for everyone, in order: all tell the first one, and it tells all.
    pub fn everywhere<T: Serialize + DeserializeOwned>(&self, own: &T) -> Vec<T> {
        let own = to_bytes(own);
        let talk = |ranks: &dyn Ranks| {
            let first = self.ranks.start;
            if !self.is_first() {
                ranks.send(first, &own);
                return from_bytes(&ranks.receive(first));
            }
            let others = || self.ranks.clone().skip(1);
            let all: Vec<Vec<u8>> =
                std::iter::once(own.clone()).chain(others().map(|rank| ranks.receive(rank))).collect();
            let bytes = to_bytes(&all);
            others().for_each(|rank| ranks.send(rank, &bytes));
            all
        };
        let all: Vec<Vec<u8>> = match &self.company {
            Some(company) => company.timed(talk, |all| all.iter().map(Vec::len).sum::<usize>() - own.len()),
            None => vec![own],
        };
        all.iter().map(|bytes| from_bytes(bytes)).collect()
    }
}

fn to_bytes<T: Serialize>(value: &T) -> Vec<u8> {
    postcard::to_stdvec(value).expect("state that can be saved can be told")
}

/// # Panics
/// Where bytes mean nothing: ranks of one version tell one another nothing else.
fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> T {
    postcard::from_bytes(bytes).expect("what a rank of the same version told")
}

#[cfg(test)]
pub mod threads {
    //! Ranks that are threads.

    use std::sync::{
        Mutex,
        mpsc::{Receiver, Sender, channel},
    };

    use super::{Company, Ranks};

    /// A channel to and from each of the others.
    struct Thread {
        number: usize,
        to: Vec<Mutex<Sender<Vec<u8>>>>,
        from: Vec<Mutex<Receiver<Vec<u8>>>>,
    }

    impl Ranks for Thread {
        fn number(&self) -> usize {
            self.number
        }

        fn count(&self) -> usize {
            self.to.len()
        }

        fn send(&self, to: usize, bytes: &[u8]) {
            self.to[to].lock().unwrap().send(bytes.to_vec()).unwrap();
        }

        fn receive(&self, from: usize) -> Vec<u8> {
            self.from[from].lock().unwrap().recv().unwrap()
        }

        fn everywhere(&self, own: &[u8]) -> Vec<Vec<u8>> {
            (0..self.count()).for_each(|to| self.send(to, own));
            (0..self.count()).map(|from| self.receive(from)).collect()
        }

        fn of_first(&self, own: Vec<u8>) -> Vec<u8> {
            if self.number == 0 {
                (0..self.count()).for_each(|to| self.send(to, &own));
            }
            self.receive(0)
        }

        fn abort(&self, code: i32) -> ! {
            panic!("rank {} gave up with {code}", self.number)
        }
    }

    /// Runs `work` on so many ranks side by side; what each came to, by rank.
    pub fn together<T: Send>(count: usize, work: impl Fn(std::sync::Arc<Company>) -> T + Sync) -> Vec<T> {
        let mut ranks: Vec<Thread> =
            (0..count).map(|number| Thread { number, to: Vec::new(), from: Vec::new() }).collect();
        for from in 0..count {
            for to in 0..count {
                let (sender, receiver) = channel();
                ranks[from].to.push(Mutex::new(sender));
                ranks[to].from.push(Mutex::new(receiver));
            }
        }
        std::thread::scope(|scope| {
            let work = &work;
            let runs: Vec<_> =
                ranks.into_iter().map(|rank| scope.spawn(move || work(Company::new(Box::new(rank))))).collect();
            runs.into_iter().map(|run| run.join().unwrap()).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::threads::together;

    #[test]
    fn what_all_have_comes_together_at_the_first() {
        for count in 1..=9 {
            let sums = together(count, |company| {
                let mut sum = 1u64 << company.number();
                let save = |sum: &u64| sum.to_le_bytes().to_vec();
                company.fold(&mut sum, save, |sum, bytes| *sum += u64::from_le_bytes(bytes.try_into().unwrap()));
                sum
            });
            assert_eq!(sums[0], (1 << count) - 1, "{count} ranks");
        }
    }

    #[test]
    fn pieces_of_work_are_all_somebodys() {
        for count in 1..=20 {
            let own = together(count, |company| {
                let ranks = (0..8).map(|piece| company.ranks_at(piece, 8));
                (company.own(8), ranks.collect::<Vec<_>>())
            });
            for piece in 0..8 {
                let has_it = |rank: &usize| own[*rank].0.contains(&piece);
                let ranks: Vec<usize> = (0..count).filter(has_it).collect();
                assert!(
                    own.iter().all(|(_, told)| told[piece].clone().eq(ranks.iter().copied())),
                    "{count} ranks: {own:?}"
                );
                assert!(!ranks.is_empty() && ranks.len() <= count.div_ceil(8), "{count} ranks: {own:?}");
            }
        }
    }

    #[test]
    fn all_hear_all_by_number_and_what_the_first_says() {
        let heard = together(5, |company| {
            let all = company.everywhere(&(company.number() as u32 * 7));
            let first: String = company.of_first(company.is_first().then(|| "go on".to_owned()).as_ref());
            (all, first, company.talk().messages)
        });
        for rank in heard {
            assert_eq!(rank, (vec![0, 7, 14, 21, 28], "go on".to_owned(), 2));
        }
    }
}
