//! What must hold of numbers before they are used.

use crate::error::Error;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Values looked at together.
const BLOCK: usize = 1024;

/// That two arguments are equally long.
pub fn same_length(
    what: &'static str,
    got: usize,
    other: &'static str,
    wanted: usize,
) -> Result<(), Error> {
    if got == wanted {
        return Ok(());
    }
    Err(Error::Length {
        what,
        got,
        other,
        wanted,
    })
}

/// That every element is a finite number.
pub fn finite(what: &'static str, values: &[f64]) -> Result<(), Error> {
    if all_finite(values) {
        return Ok(());
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(Error::NotFinite {
            what,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}

/// That every element is finite and not negative.
pub fn not_negative(what: &'static str, values: &[f64]) -> Result<(), Error> {
    let bad = |v: &f64| !(v.is_finite() && *v >= 0.0);
    match values.iter().position(bad) {
        Some(index) => Err(Error::Weight {
            what,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}

/// Whether every value is finite.
pub fn all_finite(values: &[f64]) -> bool {
    let mut finite = true;
    let found = &mut finite;
    dispatch(InstructionSet::best(), Finite { values, found });
    finite
}

/// The look for values that are not finite, in vectors: without a branch for each.
struct Finite<'a> {
    values: &'a [f64],
    found: &'a mut bool,
}

impl Kernel for Finite<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for part in self.values.chunks(BLOCK) {
            let mut bad = 0;
            for value in part {
                bad |= i64::from(!value.is_finite());
            }
            *self.found &= bad == 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_value_that_is_not_finite_is_seen() {
        let mut values = vec![1.0; 3 * BLOCK + 7];
        assert!(all_finite(&values) && all_finite(&[]));
        for (at, bad) in [
            (0, f64::NAN),
            (2000, f64::INFINITY),
            (3 * BLOCK + 6, f64::NEG_INFINITY),
        ] {
            values[at] = bad;
            assert!(!all_finite(&values));
            values[at] = -f64::MAX;
        }
        assert!(all_finite(&values));
    }
}
