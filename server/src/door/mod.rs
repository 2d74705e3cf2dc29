//! Owns who may call what: tokens with roles, and the guard in front of all calls.
//!
//! There is always a token, also on loopback, because the loopback of a login node is shared by everybody on it: the
//! server keeps one in a file that only its own account can read, and programs of that account find it by themselves.

mod certificate;
mod guard;
mod role;
mod tokens;

pub use certificate::{TlsFiles, make_certificate};
pub(crate) use guard::{guard, is_call};
pub use role::Role;
pub use tokens::{Tokens, line, new_token};
