//! The windows whose correspondences are searched at once, each by a worker of its own.
//!
//! In: phase maps. Out: correspondences, in the order of the windows. The bytes do not depend on the number of windows,
//! because workers keep no information from one window to the next. Cost: a window that is searched alone has all
//! threads; a second one takes what it leaves idle, and the memory of another worker and window.

use std::convert::Infallible;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use rayon::{ThreadPool, ThreadPoolBuilder};

use fringeflow::correspondence::MatchError;
use fringeflow::worker::{CorrespondenceWorker, Correspondences, PhasePair};
use fringeflow_message::MapsHeader;
use fringeflow_runtime::{ServiceError, clock};

use crate::warm_up::note_failure;

/// Number of threads from which on two windows are searched at once. A fifth of a search runs serially, so it keeps 2.4
/// of 4 threads busy, but 3.2 of 8. More than two would wait for the phase service, which decodes one window at a time.
const THREADS_FOR_TWO: usize = 8;

/// All searches; they take windows in turn.
pub(super) struct Searches {
    searches: Vec<Search>,
    /// Number of windows begun and ended.
    begun: usize,
    ended: usize,
}

/// Searches one window at a time. The threads are its own: in a shared pool, a thread that waits for a part of its
/// window could take up another window meanwhile.
struct Search {
    threads: ThreadPool,
    /// `None` while it is searched.
    window: Option<Box<SearchedWindow>>,
    to_result: SyncSender<Searched>,
    result: Receiver<Searched>,
}

/// A window, and when its search ended, or why it found nothing.
type Searched = (Box<SearchedWindow>, Result<u64, MatchError>);

/// A window, its worker, and what was found in it.
pub(super) struct SearchedWindow {
    worker: CorrespondenceWorker,
    /// Header of `maps`.
    pub(super) header: MapsHeader,
    pub(super) maps: PhasePair,
    pub(super) correspondences: Correspondences,
}

impl Searches {
    /// The searches that suit a number of threads. Each may use all of them.
    ///
    /// # Errors
    /// The system refuses a thread.
    pub(super) fn new(worker: &CorrespondenceWorker, threads: usize) -> Result<Self, ServiceError> {
        let at_once = if threads < THREADS_FOR_TWO { 1 } else { 2 };
        let searches = (0..at_once).map(|_| Search::new(worker.clone(), threads));
        Ok(Self { searches: searches.collect::<Result<_, _>>()?, begun: 0, ended: 0 })
    }

    /// Searches a window with every worker, so that its memory and threads are there.
    pub(super) fn warm_up(&mut self, maps: &PhasePair) {
        for _ in 0..self.at_once() {
            let Ok(()) = self.begin(|window| window.copy_maps(maps));
        }
        (0..self.at_once()).filter_map(|_| self.end_oldest(Duration::MAX)).for_each(note_failure);
    }

    /// Number of windows that may be in work.
    pub(super) fn at_once(&self) -> usize {
        self.searches.len()
    }

    /// Begins to search the window that `read` reads. No more than [`Self::at_once`] may be in work.
    ///
    /// # Errors
    /// Those of `read`; no window is in work then.
    pub(super) fn begin<E>(&mut self, read: impl FnOnce(&mut SearchedWindow) -> Result<(), E>) -> Result<(), E> {
        let number = self.begun % self.searches.len();
        let Search { threads, window, to_result, .. } = &mut self.searches[number];
        if let Some(window) = window {
            read(window)?;
        }
        let Some(mut window) = window.take() else { return Ok(()) };
        self.begun += 1;
        let (span, to_result) = (tracing::Span::current(), to_result.clone());
        // A panic in the pool ends the process, and the supervisor starts it again.
        threads.spawn(move || {
            let result = span.in_scope(|| window.worker.step(&window.maps, &mut window.correspondences));
            // The receiver lives as long as the service.
            let _ = to_result.send((window, result.map(|()| clock::now_ns())));
        });
        Ok(())
    }

    /// Returns when the search of the oldest window in work ended; [`Self::last`] is that window then. `None` if it has
    /// not ended after `timeout`.
    ///
    /// # Errors
    /// There are no correspondences.
    pub(super) fn end_oldest(&mut self, timeout: Duration) -> Option<Result<u64, MatchError>> {
        let number = self.ended % self.searches.len();
        let Search { window, result, .. } = &mut self.searches[number];
        let (searched, ended_ns) = result.recv_timeout(timeout).ok()?;
        *window = Some(searched);
        self.ended += 1;
        Some(ended_ns)
    }

    /// The window whose search ended last, until as many further ones have begun as may be in work.
    pub(super) fn last(&self) -> Option<&SearchedWindow> {
        self.searches[self.ended.checked_sub(1)? % self.searches.len()].window.as_deref()
    }
}

impl Search {
    fn new(worker: CorrespondenceWorker, threads: usize) -> Result<Self, ServiceError> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|_| "search".to_owned()).build();
        let refused = |error| ServiceError::Unusable(format!("{threads} threads cannot be started: {error}"));
        let (to_result, result) = sync_channel(1);
        let window = SearchedWindow {
            worker,
            header: MapsHeader::default(),
            maps: PhasePair::default(),
            correspondences: Correspondences::default(),
        };
        Ok(Self { threads: pool.map_err(refused)?, window: Some(Box::new(window)), to_result, result })
    }
}

impl SearchedWindow {
    /// Reads maps that are already decoded.
    fn copy_maps(&mut self, maps: &PhasePair) -> Result<(), Infallible> {
        self.maps.clone_from(maps);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::super::new_worker;
    use super::*;
    use crate::warm_up::tests::{maps_of_wall, scanner};

    #[test]
    fn windows_searched_at_once_end_in_order_with_the_bytes_of_one_worker() {
        let (configuration, setup, table) = scanner();
        let walls: Vec<PhasePair> =
            [0.0, 0.004, -0.003, 0.002, -0.005].map(|nearer_m| maps_of_wall(&configuration, &setup, nearer_m)).into();
        let mut worker = new_worker(&configuration, &setup, &table).unwrap();
        let mut searches = Searches::new(&worker, THREADS_FOR_TWO).unwrap();
        let mut expected = |maps: &PhasePair| {
            let mut found = Correspondences::default();
            worker.step(maps, &mut found).unwrap();
            found
        };
        assert_eq!(searches.at_once(), 2);
        searches.warm_up(&walls[1]);
        let mut in_work = VecDeque::new();
        for maps in walls.iter().chain(&walls) {
            if in_work.len() == searches.at_once() {
                let wanted = expected(in_work.pop_front().unwrap());
                searches.end_oldest(Duration::MAX).unwrap().unwrap();
                assert!(searches.last().unwrap().correspondences == wanted);
            }
            searches.begin(|window| window.copy_maps(maps)).unwrap();
            in_work.push_back(maps);
        }
        for maps in in_work {
            searches.end_oldest(Duration::MAX).unwrap().unwrap();
            assert!(searches.last().unwrap().correspondences == expected(maps));
        }
    }

    #[test]
    fn a_window_that_cannot_be_read_is_not_in_work() {
        let (configuration, setup, table) = scanner();
        let maps = maps_of_wall(&configuration, &setup, 0.0);
        let worker = new_worker(&configuration, &setup, &table).unwrap();
        let mut searches = Searches::new(&worker, 1).unwrap();
        assert_eq!((searches.at_once(), searches.last().is_none()), (1, true));
        assert_eq!(searches.begin(|_| Err("cut")), Err("cut"));
        searches.begin(|window| window.copy_maps(&maps)).unwrap();
        searches.end_oldest(Duration::MAX).unwrap().unwrap();
        // Maps of another size: the search tells why it found nothing, and the next window is searched all the same.
        searches.begin(|window| window.copy_maps(&PhasePair::default())).unwrap();
        assert!(searches.end_oldest(Duration::MAX).unwrap().is_err());
        searches.begin(|window| window.copy_maps(&maps)).unwrap();
        assert!(searches.end_oldest(Duration::MAX).unwrap().is_ok());
    }
}
