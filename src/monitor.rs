//! A running joint against its model: windows of readings in constant memory, and charts on them.

pub mod chart;
pub mod recent;
pub mod watch;
pub mod window;

pub use watch::{Closed, Monitor, Moved};
