//! Long work that can be called off: by Ctrl-C, from the thread that waits for it.
//!
//! Whoever starts work that may take long does so [`within`] a check. The work says now
//! and then that it is at a [`point`] where it may stop; there the check is asked, not
//! more often than it can be heard, and where it says so the work is left by unwinding.
//! Threads that help have no check: they stop because nothing is handed out to them.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{self, AssertUnwindSafe};
use std::time::{Duration, Instant};

/// Time between two questions: a person does not notice, and asking is cheap beside it.
const PATIENCE: Duration = Duration::from_millis(50);

/// The work was called off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

type Check = Box<dyn FnMut() -> bool>;

thread_local! {
    static CHECK: RefCell<Option<Check>> = const { RefCell::new(None) };
    static NEXT: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// Puts the check of the work outside back.
struct Outer(Option<Check>, Option<Instant>);

impl Drop for Outer {
    fn drop(&mut self) {
        CHECK.set(self.0.take());
        NEXT.set(self.1);
    }
}

/// `work()`, unless `check` says at one of its points that it is to stop.
///
/// What the work was changing when it was left is in no defined state: it changes only
/// what nobody looks at before it is done.
pub fn within<T>(
    check: impl FnMut() -> bool + 'static,
    work: impl FnOnce() -> T,
) -> Result<T, Interrupted> {
    let outer = Outer(
        CHECK.replace(Some(Box::new(check))),
        NEXT.replace(Some(Instant::now() + PATIENCE)),
    );
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    drop(outer);
    done.map_err(|payload: Box<dyn Any + Send>| match payload.downcast() {
        Ok(interrupted) => *interrupted,
        Err(other) => panic::resume_unwind(other),
    })
}

/// True where the work of this thread is to stop.
fn is_over() -> bool {
    if NEXT.get().is_none_or(|next| Instant::now() < next) {
        return false;
    }
    // Taken out meanwhile: a check may do work of its own.
    let Some(mut check) = CHECK.take() else {
        return false;
    };
    let over = check();
    CHECK.set(Some(check));
    NEXT.set(Some(Instant::now() + PATIENCE));
    over
}

/// A place where work may stop; does not return where it is to.
pub fn point() {
    point_after(|| {});
}

/// As [`point`]; `last` is done before the work is left.
pub fn point_after(last: impl FnOnce()) {
    if is_over() {
        last();
        panic::resume_unwind(Box::new(Interrupted));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_stops_at_a_point_and_not_before() {
        let start = Instant::now();
        let done = within(
            || true,
            || {
                loop {
                    point();
                }
            },
        );
        assert_eq!(done, Err::<(), _>(Interrupted));
        assert!(start.elapsed() >= PATIENCE);
        point(); // outside there is no check
    }

    #[test]
    fn work_that_goes_on_returns_its_value() {
        assert_eq!(within(|| false, || 7), Ok(7));
        let inner = within(|| true, || within(|| false, || 3));
        assert_eq!(inner, Ok(Ok(3)));
    }

    #[test]
    fn threads_stop_with_the_one_that_waits() {
        let handed_out = std::sync::atomic::AtomicUsize::new(0);
        let work = |_| {
            handed_out.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(5));
        };
        let parts = 10_000;
        let done = within(|| true, || crate::threads::for_each_part(parts, 2, work));
        assert_eq!(done, Err(Interrupted));
        assert!(handed_out.into_inner() < parts / 10);
    }
}
