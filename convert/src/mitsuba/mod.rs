//! Owns Mitsuba's XML scenes, of version 3 and 0.6.

use std::path::Path;

use crate::{ConvertError, Converted};

/// Reads a scene and everything it includes.
pub(crate) fn convert(path: &Path) -> Result<Converted, ConvertError> {
    Err(ConvertError::Unknown { path: path.to_owned() })
}
