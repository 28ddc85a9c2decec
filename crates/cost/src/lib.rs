//! What approximations and effects cost, measured on the user's scene and device (docs/cost.md).
//!
//! [`sweep::Sweep`] draws the scene's reference, every rung alone and some combinations; [`table::Table`] is what it found,
//! [`report`] the page that shows it. [`explain`] prices effects that a plan leaves out.

pub mod choose;
pub mod compare;
pub mod difference;
pub mod explain;
pub mod forecast;
pub mod orders;
mod price;
pub mod report;
pub mod sitting;
pub mod sweep;
pub mod table;
