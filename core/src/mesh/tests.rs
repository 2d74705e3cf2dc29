//! Owns tests
