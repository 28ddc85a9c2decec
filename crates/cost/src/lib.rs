//! Measures what approximations and effects cost, in error and GPU time, on a scene and a device (docs/cost.md).
//!
//! [`sweep::Sweep`] draws a reference, every rung alone, and some combinations of rungs. [`agenda`] lists the pictures,
//! [`measure`] draws and times them, [`reference`](mod@reference) draws the picture that they are compared with, and
//! [`judge`] computes their errors. The result is [`table::Table`]; [`report`] writes it as an HTML page. [`explain`]
//! measures effects that a plan leaves out.

pub mod agenda;
pub mod beside;
pub mod choose;
pub mod command;
pub mod compare;
pub mod difference;
pub mod explain;
pub mod forecast;
pub mod judge;
pub mod loss;
pub mod measure;
pub mod orders;
pub mod pace;
pub mod predict;
pub mod price;
pub mod reference;
pub mod report;
mod run;
pub mod search;
pub mod size;
pub mod statistics;
pub mod sweep;
pub mod table;
pub mod tiles;
pub mod warm;
