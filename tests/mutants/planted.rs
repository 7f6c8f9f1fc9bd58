//! Which planted fault is switched on, and which were reached: written into copies of the project.

extern crate std;

use std::io::Write as _;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Faults at most.
const MOST: usize = 4096;

/// Reached since this was last cleared, from outside too.
#[unsafe(no_mangle)]
pub static TRUEANGLE_SEEN: [AtomicBool; MOST] = [const { AtomicBool::new(false) }; MOST];

/// The file that is told what is reached, where there is one, and the fault that is switched on.
static ASKED: OnceLock<(Option<std::string::String>, Option<usize>)> = OnceLock::new();

/// Whether it is this one.
#[inline(never)]
pub fn is(number: usize) -> bool {
    let (record, chosen) = ASKED.get_or_init(|| {
        let chosen = std::env::var("TRUEANGLE_PLANTED").ok();
        let record = std::env::var("TRUEANGLE_REACHED").ok();
        (record, chosen.and_then(|text| text.parse().ok()))
    });
    if let Some(path) = record
        && !TRUEANGLE_SEEN[number].load(Relaxed)
        && !TRUEANGLE_SEEN[number].swap(true, Relaxed)
    {
        let mut file = std::fs::OpenOptions::new().append(true).open(path).unwrap();
        file.write_all(std::format!("{number}\n").as_bytes()).unwrap();
    }
    *chosen == Some(number)
}
