//! Distributed rendering: work split over processes and machines, whose joined result is bit-identical to one run. See
//! docs/farm.md.
//!
//! Etalon has no scheduler; it writes job files for existing engines. [`frames`] selects the frames of a process,
//! [`names`] the file names, and [`identity`] identifies the picture of a file. [`part`] stores the part of a still
//! picture that one process drew, and [`join`] joins the parts. [`job`] writes job files, and [`account`] a report
//! about the workers.

pub mod account;
pub mod frames;
pub mod identity;
pub mod job;
pub mod join;
pub mod names;
pub mod part;
pub mod worker;
