//! A value made at its first use, without a lock.
//!
//! A process that is forked while another of its threads holds a lock finds it held for
//! good. Here nobody waits: threads that meet each make the value, and one of them keeps
//! its own. What is made is a pure function of what is known, so it does not matter whose.

use std::fmt;
use std::marker::PhantomData;
use std::ptr;
use std::sync::atomic::{AtomicPtr, Ordering};

/// Nothing at first, then one value for good.
pub struct Once<T> {
    value: AtomicPtr<T>,
    owned: PhantomData<Box<T>>,
}

impl<T> Once<T> {
    /// The value, where it has been made.
    #[inline]
    pub fn get(&self) -> Option<&T> {
        // SAFETY: the pointer is null or a box that lives as long as `self`.
        unsafe { self.value.load(Ordering::Acquire).as_ref() }
    }

    /// The value, made by `make` where there is none yet.
    #[inline]
    pub fn get_or_init(&self, make: impl FnOnce() -> T) -> &T {
        match self.get() {
            Some(value) => value,
            None => self.fill(make()),
        }
    }

    #[cold]
    fn fill(&self, value: T) -> &T {
        let fresh = Box::into_raw(Box::new(value));
        let empty = ptr::null_mut();
        let (success, failure) = (Ordering::AcqRel, Ordering::Acquire);
        match self.value.compare_exchange(empty, fresh, success, failure) {
            // SAFETY: `fresh` belongs to `self` from here on.
            Ok(_) => unsafe { &*fresh },
            Err(first) => {
                // SAFETY: nobody else has seen `fresh`; `first` belongs to `self`.
                unsafe {
                    drop(Box::from_raw(fresh));
                    &*first
                }
            }
        }
    }
}

impl<T> Default for Once<T> {
    fn default() -> Self {
        Self {
            value: AtomicPtr::new(ptr::null_mut()),
            owned: PhantomData,
        }
    }
}

impl<T> Drop for Once<T> {
    fn drop(&mut self) {
        let value = *self.value.get_mut();
        if !value.is_null() {
            // SAFETY: made by `fill`, and nobody borrows `self` any more.
            drop(unsafe { Box::from_raw(value) });
        }
    }
}

impl<T: fmt::Debug> fmt::Debug for Once<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Once").field(&self.get()).finish()
    }
}

// SAFETY: shared like a box that several threads may fill and read: the value is sent from
// the thread that made it, and read by all.
unsafe impl<T: Send + Sync> Sync for Once<T> {}
// SAFETY: as a box.
unsafe impl<T: Send> Send for Once<T> {}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;
    use std::sync::atomic::AtomicUsize;

    use super::*;

    #[test]
    fn threads_that_meet_see_one_value() {
        const THREADS: usize = 8;
        for _ in 0..50 {
            let (once, start) = (Once::default(), Barrier::new(THREADS));
            let made = AtomicUsize::new(0);
            let make = || made.fetch_add(1, Ordering::Relaxed);
            let look = || {
                start.wait();
                *once.get_or_init(make)
            };
            let seen: Vec<_> = std::thread::scope(|scope| {
                let threads: Vec<_> = (0..THREADS).map(|_| scope.spawn(look)).collect();
                threads.into_iter().map(|t| t.join().unwrap()).collect()
            });
            assert!(seen.iter().all(|value| *value == seen[0]));
            assert_eq!(once.get(), Some(&seen[0]));
        }
    }

    #[test]
    fn what_is_kept_is_dropped_once() {
        struct Counted<'a>(&'a AtomicUsize);
        impl Drop for Counted<'_> {
            fn drop(&mut self) {
                self.0.fetch_add(1, Ordering::Relaxed);
            }
        }
        let dropped = AtomicUsize::new(0);
        let once = Once::default();
        once.get_or_init(|| Counted(&dropped));
        once.get_or_init(|| unreachable!());
        assert_eq!(dropped.load(Ordering::Relaxed), 0);
        drop(once);
        assert_eq!(dropped.load(Ordering::Relaxed), 1);
    }
}
