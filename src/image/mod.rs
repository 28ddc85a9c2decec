//! Pictures as data: reading, writing, comparing.
