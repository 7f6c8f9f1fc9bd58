//! Input and output of one batch: two slices of one length, or one slice that is both.

use std::any::TypeId;
use std::marker::PhantomData;

use crate::error::Error;

/// A number a batch may hold: kernels compute in f64 and convert while loading and storing.
pub trait Sample: Copy + Send + Sync + 'static {
    /// True for integers, which may be looked up by their place within a turn.
    const IS_COUNT: bool;

    /// The exact value, or the nearest double (integers beyond 2^53).
    fn widen(self) -> f64;

    /// Place of an integer within a turn of so many counts; 0 for other numbers.
    fn place(self, counts_per_turn: usize) -> usize;
}

/// A sample that results can be stored in.
pub trait Real: Sample {
    /// The value nearest to a double.
    fn narrow(value: f64) -> Self;
}

impl Sample for f64 {
    const IS_COUNT: bool = false;

    #[inline(always)]
    fn widen(self) -> f64 {
        self
    }

    #[inline(always)]
    fn place(self, _: usize) -> usize {
        0
    }
}

impl Real for f64 {
    #[inline(always)]
    fn narrow(value: f64) -> Self {
        value
    }
}

impl Sample for f32 {
    const IS_COUNT: bool = false;

    #[inline(always)]
    fn widen(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn place(self, _: usize) -> usize {
        0
    }
}

impl Real for f32 {
    #[inline(always)]
    fn narrow(value: f64) -> Self {
        value as f32
    }
}

/// True for f32 to f32: kernels may then compute in single precision.
pub fn is_single<X: Sample, Y: Real>() -> bool {
    [TypeId::of::<X>(), TypeId::of::<Y>()] == [TypeId::of::<f32>(); 2]
}

/// Samples to read and places to write, element by element.
pub struct Batch<'a, X, Y> {
    x: *const X,
    out: *mut Y,
    len: usize,
    life: PhantomData<(&'a [X], &'a mut [Y])>,
}

// SAFETY: a batch is a shared and an exclusive slice, or one exclusive slice.
unsafe impl<X: Sync, Y: Send> Send for Batch<'_, X, Y> {}

impl<'a, X: Copy, Y: Copy> Batch<'a, X, Y> {
    /// Results of `x` go to `out`.
    pub fn apart(x: &'a [X], out: &'a mut [Y]) -> Result<Self, Error> {
        if x.len() != out.len() {
            return Err(Error::Length {
                what: "out",
                got: out.len(),
                other: "the angles",
                wanted: x.len(),
            });
        }
        // SAFETY: both slices live for 'a and are equally long.
        Ok(unsafe { Self::from_raw(x.as_ptr(), out.as_mut_ptr(), x.len()) })
    }

    /// A batch over raw memory.
    ///
    /// # Safety
    /// `x` is readable and `out` writable for `len` aligned elements during `'a`, and
    /// the two are either the same memory with elements of one size or do not overlap.
    pub unsafe fn from_raw(x: *const X, out: *mut Y, len: usize) -> Self {
        Self {
            x,
            out,
            len,
            life: PhantomData,
        }
    }

    /// Number of samples.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// True when there is nothing to do.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Samples `start..start + len` as a batch of their own.
    ///
    /// # Safety
    /// The range lies within this batch, and no other part in use overlaps it.
    pub unsafe fn part(&self, start: usize, len: usize) -> Batch<'a, X, Y> {
        debug_assert!(start + len <= self.len);
        // SAFETY: inside this batch by the caller's promise.
        unsafe { Batch::from_raw(self.x.add(start), self.out.add(start), len) }
    }

    /// Where the samples start.
    #[inline(always)]
    pub fn input(&self) -> *const X {
        self.x
    }

    /// Where the results start.
    #[inline(always)]
    pub fn output(&mut self) -> *mut Y {
        self.out
    }

    /// Replaces every sample by `f` of it.
    #[inline(always)]
    pub fn map(&mut self, mut f: impl FnMut(X) -> Y) {
        for i in 0..self.len {
            // SAFETY: i < len; each sample is read before its own place is written.
            unsafe { self.out.add(i).write(f(self.x.add(i).read())) };
        }
    }
}

/// Samples of one block: what is computed of it stays in the first-level cache.
const BLOCK: usize = 256;

impl<'a, X: Sample, Y: Real> Batch<'a, X, Y> {
    /// The same, where both types are f32.
    pub fn into_single(self) -> Option<Batch<'a, f32, f32>> {
        // SAFETY: the types are the same.
        is_single::<X, Y>()
            .then(|| unsafe { Batch::from_raw(self.x.cast(), self.out.cast(), self.len) })
    }

    /// Samples from `start` on, as doubles.
    pub fn widen(&self, start: usize, into: &mut [f64]) {
        assert!(start + into.len() <= self.len);
        for (i, x) in into.iter_mut().enumerate() {
            // SAFETY: start + i < len.
            *x = unsafe { self.x.add(start + i).read() }.widen();
        }
    }

    /// Stores results from `start` on.
    pub fn narrow(&mut self, start: usize, from: &[f64]) {
        assert!(start + from.len() <= self.len);
        for (i, &value) in from.iter().enumerate() {
            // SAFETY: start + i < len.
            unsafe { self.out.add(start + i).write(Y::narrow(value)) };
        }
    }

    /// Blocks as doubles through `f(samples, results)`.
    pub fn map_blocks(&mut self, mut f: impl FnMut(&[f64], &mut [f64])) {
        let (mut x, mut out) = ([0.0; BLOCK], [0.0; BLOCK]);
        for start in (0..self.len).step_by(BLOCK) {
            let len = BLOCK.min(self.len - start);
            self.widen(start, &mut x[..len]);
            f(&x[..len], &mut out[..len]);
            self.narrow(start, &out[..len]);
        }
    }
}

impl<'a, X: Copy> Batch<'a, X, X> {
    /// Results replace their own samples.
    pub fn in_place(data: &'a mut [X]) -> Self {
        let start = data.as_mut_ptr();
        // SAFETY: one exclusive slice, read and written element by element.
        unsafe { Self::from_raw(start, start, data.len()) }
    }
}

/// A batch that threads take disjoint parts of.
pub struct Shared<'a, X, Y>(Batch<'a, X, Y>);

// SAFETY: only `part` is called through the shared reference, on disjoint ranges.
unsafe impl<X: Sync, Y: Send> Sync for Shared<'_, X, Y> {}

impl<'a, X, Y> Shared<'a, X, Y> {
    /// To be taken apart by `Batch::part`.
    pub fn new(batch: Batch<'a, X, Y>) -> Self {
        Self(batch)
    }

    /// The whole.
    pub fn get(&self) -> &Batch<'a, X, Y> {
        &self.0
    }
}

macro_rules! counts {
    ($($int:ty),*) => {$(
        impl Sample for $int {
            const IS_COUNT: bool = true;

            #[inline(always)]
            fn widen(self) -> f64 {
                self as f64
            }

            #[inline(always)]
            fn place(self, counts_per_turn: usize) -> usize {
                // Negative counts become huge: one comparison finds them and the high.
                let place = self as i64 as u64;
                if place < counts_per_turn as u64 {
                    place as usize
                } else {
                    (i128::from(self)).rem_euclid(counts_per_turn as i128) as usize
                }
            }
        }
    )*};
}
counts!(i8, i16, i32, i64, u8, u16, u32, u64);
