//! How a batch is computed: the path and the instruction set.

use std::fmt;
use std::str::FromStr;

use crate::simd::InstructionSet;

/// How to compute a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// Piecewise polynomials over one turn.
    Table,
    /// The same in cubics of single precision, for f32.
    Cubics,
    /// One sine and cosine per group of orders and sample, then Horner's rule.
    Exact,
    /// One sine and cosine per sample and order, by the platform's libm: the reference.
    Direct,
    /// One entry per count.
    Counts,
}

impl Path {
    /// Every path, by its name.
    const NAMES: [(&str, Self); 5] = [
        ("table", Self::Table),
        ("cubics", Self::Cubics),
        ("exact", Self::Exact),
        ("direct", Self::Direct),
        ("counts", Self::Counts),
    ];
}

/// A path on an instruction set: `table-avx512`, or `table` for the best there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Route {
    /// How.
    pub path: Path,
    /// On what.
    pub set: InstructionSet,
}

impl fmt::Display for Route {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = Path::NAMES.iter();
        for (name, _) in names.filter(|(_, path)| *path == self.path) {
            f.write_str(name)?;
        }
        match self.path {
            // Neither has vectors.
            Path::Direct | Path::Counts => Ok(()),
            Path::Table | Path::Cubics | Path::Exact => write!(f, "-{}", self.set.name()),
        }
    }
}

impl FromStr for Route {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (path, set) = match text.split_once('-') {
            Some((path, set)) => (path, InstructionSet::named(set).ok_or(())?),
            None => (text, InstructionSet::best()),
        };
        let found = Path::NAMES.iter().find(|(name, _)| *name == path);
        let &(_, path) = found.ok_or(())?;
        Ok(Self { path, set })
    }
}
