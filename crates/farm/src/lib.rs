//! Work that is split over processes and machines, and joined to the bits of one run.
//!
//! Etalon has no scheduler: it makes work that any engine can split. [`frames`] says which frames a process draws, [`names`] which files
//! they go to, [`identity`] what a file is a picture of, [`part`] keeps the part of a still that one process drew, [`join`] makes the
//! whole of the parts, [`job`] writes files for engines, and [`account`] lays side by side what the workers tell of themselves.

pub mod account;
pub mod frames;
pub mod identity;
pub mod job;
pub mod join;
pub mod names;
pub mod part;
pub mod worker;
