//! One standing pool of threads for everything that is worth splitting.
//!
//! Its size is `TRUEANGLE_NUM_THREADS`, else `RAYON_NUM_THREADS`, else the number of
//! cores this process may run on. A forked child does not inherit threads, so the pool
//! belongs to one process id and a child that needs threads starts its own.

use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::available_parallelism;

use rayon::{ThreadPool, ThreadPoolBuilder};

struct Standing {
    process: u32,
    pool: ThreadPool,
}

/// The pool in use. Superseded pools are leaked: in a forked child their threads do not
/// exist, so neither using nor dropping them could ever return.
static STANDING: AtomicPtr<Standing> = AtomicPtr::new(std::ptr::null_mut());

/// Threads used when none are asked for.
pub fn available() -> usize {
    ["TRUEANGLE_NUM_THREADS", "RAYON_NUM_THREADS"]
        .iter()
        .filter_map(|name| std::env::var(name).ok()?.trim().parse().ok())
        .find(|&n: &usize| n > 0)
        .unwrap_or_else(|| available_parallelism().map_or(1, usize::from))
}

/// The standing pool with at least `threads` threads, or `None` where threads cannot be
/// started.
pub fn pool(threads: usize) -> Option<&'static ThreadPool> {
    let process = std::process::id();
    let current = STANDING.load(Ordering::Acquire);
    // SAFETY: the pointer is null or a leaked box, never freed.
    if let Some(standing) = unsafe { current.as_ref() }
        && standing.process == process
        && standing.pool.current_num_threads() >= threads
    {
        return Some(&standing.pool);
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.max(available()))
        .thread_name(|i| format!("trueangle-{i}"))
        .build()
        .ok()?;
    let fresh = Box::leak(Box::new(Standing { process, pool }));
    // Two callers may race here: the later pool stays, the earlier works for its caller.
    STANDING.store(fresh, Ordering::Release);
    Some(&fresh.pool)
}

/// Results of `work(0..parts)` in the order of the parts, from up to `threads` threads:
/// what is made of them does not depend on `threads`.
pub fn map_parts<T: Send>(
    parts: usize,
    threads: usize,
    work: impl Fn(usize) -> T + Sync,
) -> impl Iterator<Item = T> {
    let found: Vec<_> = (0..parts).map(|_| Mutex::new(None)).collect();
    for_each_part(parts, threads, |i| {
        let part = work(i);
        *found[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(part);
    });
    // Every part has run: there is a result in each place.
    found
        .into_iter()
        .filter_map(|part| part.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// Runs `work(0..parts)` on up to `threads` threads, in any order, each part once.
///
/// Parts are handed out one at a time, so a core that others slow down takes fewer.
pub fn for_each_part(parts: usize, threads: usize, work: impl Fn(usize) + Sync) {
    let threads = threads.min(parts);
    let pool = if threads > 1 { pool(threads) } else { None };
    let Some(pool) = pool else {
        (0..parts).for_each(work);
        return;
    };
    let next = AtomicUsize::new(0);
    let worker = || {
        loop {
            let part = next.fetch_add(1, Ordering::Relaxed);
            if part >= parts {
                break;
            }
            work(part);
        }
    };
    pool.in_place_scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|_| worker());
        }
        worker();
    });
}
