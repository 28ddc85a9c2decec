//! The built-in study scenes, generated; no files needed.
