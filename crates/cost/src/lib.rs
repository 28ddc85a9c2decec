//! What approximations and effects cost, measured on the user's scene and device (docs/cost.md).
//!
//! [`sweep::Sweep`] draws the scene's reference, every rung alone and some combinations: [`agenda`] says which, [`measure`] draws them,
//! [`reference`](mod@reference) is what they are held against, [`judge`] says how far they are from it. [`table::Table`] is what was found,
//! [`report`] the page that shows it. [`explain`] prices effects that a plan leaves out.

pub mod agenda;
pub mod beside;
pub mod choose;
pub mod command;
pub mod compare;
pub mod difference;
pub mod explain;
pub mod forecast;
pub mod judge;
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
pub mod warm;
