//! What approximations and effects cost, measured on the user's scene and device.

pub mod explain;
