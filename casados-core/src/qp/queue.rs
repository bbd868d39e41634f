//! A work queue for threads: each thread takes the next item when it is idle.

/// Returns the number of threads, at most `most`.
pub fn threads(most: usize) -> usize {
    #[cfg(feature = "parallel")]
    return rayon::current_num_threads().min(most).max(1);
    #[cfg(not(feature = "parallel"))]
    most.min(1)
}

/// Processes all items, with a worker for each thread. The assignment of items to workers varies
/// from run to run: results must not depend on it.
pub fn each<W: Send, I: Iterator<Item: Send> + Send>(
    workers: &mut [W],
    items: I,
    work: impl Fn(&mut W, I::Item) + Sync,
) {
    #[cfg(feature = "parallel")]
    if workers.len() > 1 {
        on_threads(workers, &std::sync::Mutex::new(items), &work);
        return;
    }
    let Some(worker) = workers.first_mut() else { return };
    items.for_each(|item| work(worker, item));
}

#[cfg(feature = "parallel")]
fn on_threads<W: Send, I: Iterator<Item: Send> + Send>(
    workers: &mut [W],
    queue: &std::sync::Mutex<I>,
    work: &(impl Fn(&mut W, I::Item) + Sync),
) {
    if let [worker] = workers {
        // The lock is held only while an item is taken.
        let next = || queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
        while let Some(item) = next() {
            work(worker, item);
        }
        return;
    }
    let (workers, others) = workers.split_at_mut(workers.len() / 2);
    rayon::join(|| on_threads(workers, queue, work), || on_threads(others, queue, work));
}
