//! The only file that names both wire and core types: translation and validation of untrusted fields.
