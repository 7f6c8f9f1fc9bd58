//! An allocator that keeps some memory back for the moment when there is no more.
//!
//! Much of what the core allocates cannot fail gently: a vector that grows or a thread's
//! queue would end the process. Large pieces are asked for before the work begins
//! ([`crate::memory::room`]); small ones that the system refuses are given from a reserve.
//! Whoever comes back from the work fills it again, and long work is left at its next
//! [`crate::interrupt::point`].

use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr;
use std::sync::atomic::{AtomicPtr, Ordering};

/// Bytes kept back: many times what any work allocates beyond what it asks for before. They
/// are never touched, so that they take addresses and no memory.
pub const BYTES: usize = 16 << 20;

/// The reserve; null where it is in use.
static KEPT: AtomicPtr<u8> = AtomicPtr::new(ptr::null_mut());

/// Of the piece kept back.
const LAYOUT: Layout = match Layout::from_size_align(BYTES, 16) {
    Ok(layout) => layout,
    Err(_) => panic!("a size and a power of two"),
};

/// The system's allocator with a reserve behind it, for `#[global_allocator]`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reserve;

/// Fills the reserve, where it is empty and the system gives as much.
#[inline]
pub fn fill() {
    if KEPT.load(Ordering::Relaxed).is_null() {
        fetch();
    }
}

/// True where the reserve is in use: memory is short.
#[inline]
pub fn is_empty() -> bool {
    KEPT.load(Ordering::Relaxed).is_null()
}

#[cold]
fn fetch() {
    // SAFETY: the size is not 0.
    let fresh = unsafe { System.alloc(LAYOUT) };
    let empty = ptr::null_mut();
    let (success, failure) = (Ordering::AcqRel, Ordering::Relaxed);
    let taken = KEPT.compare_exchange(empty, fresh, success, failure);
    if taken.is_err() && !fresh.is_null() {
        // SAFETY: another thread was faster; nobody has seen this piece.
        unsafe { System.dealloc(fresh, LAYOUT) };
    }
}

/// A second try for `size` bytes, with the reserve given back to the system.
#[cold]
fn again(size: usize, allocate: impl FnOnce() -> *mut u8) -> *mut u8 {
    if size > BYTES {
        return ptr::null_mut();
    }
    let kept = KEPT.swap(ptr::null_mut(), Ordering::AcqRel);
    if !kept.is_null() {
        // SAFETY: allocated by `fetch` with this layout, and taken out by this thread alone.
        unsafe { System.dealloc(kept, LAYOUT) };
    }
    allocate()
}

// SAFETY: every piece comes from the system's allocator and goes back to it with its layout.
unsafe impl GlobalAlloc for Reserve {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as promised by the caller, here and below.
        let place = unsafe { System.alloc(layout) };
        if !place.is_null() {
            return place;
        }
        again(layout.size(), || unsafe { System.alloc(layout) })
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        let place = unsafe { System.alloc_zeroed(layout) };
        if !place.is_null() {
            return place;
        }
        again(layout.size(), || unsafe { System.alloc_zeroed(layout) })
    }

    #[inline]
    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above; a piece that could not grow is still there.
        let place = unsafe { System.realloc(old, layout, size) };
        if !place.is_null() {
            return place;
        }
        again(size, || unsafe { System.realloc(old, layout, size) })
    }

    #[inline]
    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(place, layout) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_is_answered_from_the_reserve_once() {
        fill();
        assert!(!is_empty());
        let mut asked = 0;
        let place = again(100, || {
            asked += 1;
            ptr::dangling_mut()
        });
        assert!(is_empty());
        assert_eq!((place.is_null(), asked), (false, 1));
        assert!(again(100, ptr::null_mut).is_null());
        // What is larger is not worth it.
        fill();
        assert!(again(BYTES + 1, || unreachable!()).is_null());
        assert!(!is_empty());
    }

    #[test]
    fn pieces_are_those_of_the_system() {
        let layout = Layout::from_size_align(1000, 64).unwrap();
        // SAFETY: allocated, used within its size, and given back once.
        unsafe {
            let place = Reserve.alloc_zeroed(layout);
            assert_eq!(place.align_offset(64), 0);
            assert_eq!(*place.add(999), 0);
            *place = 7;
            let place = Reserve.realloc(place, layout, 5000);
            assert_eq!(*place, 7);
            Reserve.dealloc(place, Layout::from_size_align(5000, 64).unwrap());
        }
    }
}
