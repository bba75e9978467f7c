//! Work on all processors.

#![forbid(unsafe_code)]

use std::sync::atomic::{AtomicUsize, Ordering};

/// What this work makes of each item, in the order of the items.
pub fn map<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    map_with(items, || (), |(), item| work(item))
}

/// The same with something of its own for each thread, which is made when the thread begins.
pub fn map_with<T: Sync, S, R: Send>(
    items: &[T],
    begin: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, &T) -> R + Sync,
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let take = || {
        let (mut own, mut done) = (begin(), Vec::new());
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(place) else { return done };
            done.push((place, work(&mut own, item)));
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(items.len());
    let mut done: Vec<(usize, R)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(take)).collect();
        let join = |thread: std::thread::ScopedJoinHandle<'_, Vec<_>>| {
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        threads.into_iter().flat_map(join).collect()
    });
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..1000).collect();
        // The first items take longest.
        let work = |item: &u64| {
            std::thread::sleep(std::time::Duration::from_micros(200_u64.saturating_sub(*item)));
            item * item
        };
        assert_eq!(map(&items, work), items.iter().map(|item| item * item).collect::<Vec<_>>());
        assert!(map(&[] as &[u64], |item| *item).is_empty());
    }

    #[test]
    fn what_a_thread_has_of_its_own_stays_with_it() {
        let items: Vec<u64> = (0..1000).collect();
        let counted = map_with(
            &items,
            || 0,
            |count, _| {
                *count += 1;
                *count
            },
        );
        let threads = counted.iter().filter(|count| **count == 1).count();
        assert!(threads >= 1 && threads <= std::thread::available_parallelism().map_or(1, usize::from));
    }
}
