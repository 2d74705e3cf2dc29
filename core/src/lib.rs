//! Scene to pixels: a pure path-tracing core.

pub mod encode;
