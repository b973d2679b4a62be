//! Who may render when: jobs take their turns in the order of the queue, so many at once.

use std::collections::BTreeSet;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Hands out turns, numbered from 0 in the order in which they are due.
pub struct Turns {
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The number whose turn is next.
    next: usize,
    /// Numbers above that will not come.
    passed: BTreeSet<usize>,
    /// Turns that can be had at the moment.
    free: usize,
}

impl Turns {
    /// So many at once.
    pub fn new(at_once: usize) -> Turns {
        Turns { state: Mutex::new(State { next: 0, passed: BTreeSet::new(), free: at_once }), changed: Condvar::new() }
    }

    /// The turn of that number; each number is asked for once. A turn that is dropped without having begun is passed over.
    pub fn turn(&self, number: usize) -> Turn<'_> {
        Turn { turns: self, number, stage: Mutex::new(Stage::Due) }
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One job's turn.
pub struct Turn<'a> {
    turns: &'a Turns,
    number: usize,
    stage: Mutex<Stage>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    Due,
    Begun,
    Over,
}

impl Turn<'_> {
    /// Waits until all turns of lower numbers have begun or been passed over and one is free.
    pub fn begin(&self) {
        let mut state = self.turns.locked();
        while state.next != self.number || state.free == 0 {
            state = self.turns.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.free -= 1;
        state.advance();
        drop(state);
        self.set(Stage::Begun);
        self.turns.changed.notify_all();
    }

    /// Others may begin; nothing where it is over already.
    pub fn end(&self) {
        let before = self.set(Stage::Over);
        let mut state = self.turns.locked();
        match before {
            Stage::Due if state.next == self.number => state.advance(),
            Stage::Due => drop(state.passed.insert(self.number)),
            Stage::Begun => state.free += 1,
            Stage::Over => return,
        }
        drop(state);
        self.turns.changed.notify_all();
    }

    fn set(&self, stage: Stage) -> Stage {
        std::mem::replace(&mut *self.stage.lock().unwrap_or_else(PoisonError::into_inner), stage)
    }
}

impl State {
    fn advance(&mut self) {
        self.next += 1;
        while self.passed.remove(&self.next) {
            self.next += 1;
        }
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::thread;
    use std::time::Duration;

    use super::*;

    #[test]
    fn turns_come_in_order_and_never_more_than_so_many_at_once() {
        for at_once in [1, 3] {
            let turns = Turns::new(at_once);
            // began, and at work at the moment and at the most
            let seen = Mutex::new((Vec::new(), 0, 0));
            thread::scope(|threads| {
                for number in (0..20).rev() {
                    let (turns, seen) = (&turns, &seen);
                    threads.spawn(move || {
                        let turn = turns.turn(number);
                        if number % 5 == 2 {
                            return; // has nothing to do
                        }
                        thread::sleep(Duration::from_millis((number as u64 * 7) % 5));
                        turn.begin();
                        {
                            let (began, now, most) = &mut *seen.lock().unwrap();
                            began.push(number);
                            *now += 1;
                            *most = (*most).max(*now);
                        }
                        thread::sleep(Duration::from_millis(2));
                        seen.lock().unwrap().1 -= 1;
                        turn.end();
                        turn.end(); // what is over stays over
                    });
                }
            });
            let (mut began, now, most) = seen.into_inner().unwrap();
            if at_once > 1 {
                began.sort_unstable(); // they begin in order, but come to tell it as they like
            }
            assert_eq!(began, (0..20).filter(|number| number % 5 != 2).collect::<Vec<_>>());
            assert!(now == 0 && most <= at_once, "{most} of {at_once}");
            assert_eq!(turns.locked().free, at_once);
        }
    }
}
