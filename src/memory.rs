//! Whether there is memory for what is about to be made.

use crate::error::Error;

/// An error where the system refuses so many bytes in one piece.
///
/// Asked before work whose own allocations cannot fail gently: a process short of memory
/// gets an error it can handle instead of an abort.
pub fn room(bytes: usize) -> Result<(), Error> {
    let mut piece: Vec<u8> = Vec::new();
    piece
        .try_reserve_exact(bytes)
        .map_err(|_| Error::Memory { bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_refused() {
        assert!(room(1 << 20).is_ok());
        assert_eq!(room(1 << 60), Err(Error::Memory { bytes: 1 << 60 }));
    }
}
