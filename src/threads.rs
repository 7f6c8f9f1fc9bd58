//! One standing pool of threads for everything that is worth splitting.
//!
//! It has a thread for every core this process may run on, or as many as
//! `TRUEANGLE_NUM_THREADS` (else `RAYON_NUM_THREADS`) asks for, and never grows: whoever
//! asks for more gets these. A forked child does not inherit threads, so the pool belongs
//! to one process id and a child that needs threads starts its own.

use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::available_parallelism;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::interrupt;

/// Most threads that can be asked for.
pub const MOST_THREADS: usize = 1024;

struct Standing {
    process: u32,
    pool: ThreadPool,
}

/// The pool in use. A parent's pool is leaked in a forked child: its threads do not exist
/// there, so neither using nor dropping it could ever return.
static STANDING: AtomicPtr<Standing> = AtomicPtr::new(std::ptr::null_mut());

/// Threads used when none are asked for.
pub fn available() -> usize {
    asked_for().unwrap_or_else(cores)
}

fn asked_for() -> Option<usize> {
    ["TRUEANGLE_NUM_THREADS", "RAYON_NUM_THREADS"]
        .iter()
        .filter_map(|name| std::env::var(name).ok()?.trim().parse().ok())
        .find(|&n: &usize| n > 0)
        .map(|n| n.min(MOST_THREADS))
}

fn cores() -> usize {
    available_parallelism().map_or(1, usize::from)
}

/// Makes what all threads share before any of them is started.
///
/// The first thread that needs it would else make it under a lock, and a process forked
/// meanwhile would find that lock held for good. Python calls this while it is imported,
/// when it does not fork.
pub fn prepare() {
    drop(crossbeam_epoch::pin());
}

/// The standing pool, or `None` where threads cannot be started.
pub fn pool() -> Option<&'static ThreadPool> {
    let process = std::process::id();
    let current = STANDING.load(Ordering::Acquire);
    // SAFETY: the pointer is null or a box that is freed by nobody who could be seen here.
    if let Some(standing) = unsafe { current.as_ref() }
        && standing.process == process
    {
        return Some(&standing.pool);
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(asked_for().unwrap_or(0).max(cores()))
        .thread_name(|i| format!("trueangle-{i}"))
        .build()
        .ok()?;
    let fresh = Box::into_raw(Box::new(Standing { process, pool }));
    let (success, failure) = (Ordering::AcqRel, Ordering::Acquire);
    match STANDING.compare_exchange(current, fresh, success, failure) {
        // SAFETY: kept for good from here on.
        Ok(_) => Some(unsafe { &(*fresh).pool }),
        Err(first) => {
            // SAFETY: another thread of this process was first, and nobody has seen ours.
            unsafe {
                drop(Box::from_raw(fresh));
                Some(&(*first).pool)
            }
        }
    }
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
    let pool = if threads > 1 { pool() } else { None };
    let Some(pool) = pool else {
        for part in 0..parts {
            work(part);
            interrupt::point();
        }
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
            // Nothing is handed out any more once the caller leaves.
            interrupt::point_after(|| next.store(parts, Ordering::Relaxed));
        }
    };
    let threads = threads.min(pool.current_num_threads());
    pool.in_place_scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|_| worker());
        }
        worker();
    });
}
