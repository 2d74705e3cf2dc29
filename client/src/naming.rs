//! Names of output files.

use std::path::{Path, PathBuf};

/// `out.exr` for one frame, `out.0001.exr` for one of several.
pub(crate) fn of_frame(path: &Path, frame: i32, several: bool) -> PathBuf {
    if !several {
        return path.to_owned();
    }
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    path.with_extension(format!("{frame:04}.{ending}"))
}

/// `out-denoised.png` for `out.png`.
pub(crate) fn denoised(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-denoised.{ending}"))
}

/// A job's display name as a file name: no separators, no hidden files, never empty.
pub(crate) fn safe_stem(name: &str) -> String {
    let kept: String = name
        .chars()
        .map(|letter| if letter.is_alphanumeric() || "-_. ".contains(letter) { letter } else { '_' })
        .collect();
    let kept = kept.trim_matches(['.', ' ']);
    if kept.is_empty() { "frame".to_owned() } else { kept.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::{denoised, of_frame, safe_stem};
    use std::path::{Path, PathBuf};

    #[test]
    fn frames_and_denoised_files() {
        assert_eq!(of_frame(Path::new("a/o.exr"), 7, false), PathBuf::from("a/o.exr"));
        assert_eq!(of_frame(Path::new("a/o.exr"), 7, true), PathBuf::from("a/o.0007.exr"));
        assert_eq!(denoised(Path::new("a/o.png")), PathBuf::from("a/o-denoised.png"));
        assert_eq!(denoised(&of_frame(Path::new("o.png"), 7, true)), PathBuf::from("o.0007-denoised.png"));
    }

    #[test]
    fn a_job_cannot_choose_a_path() {
        assert_eq!(safe_stem("../../etc/passwd"), "_.._etc_passwd");
        assert_eq!(safe_stem(".."), "frame");
        assert_eq!(safe_stem("cave 2"), "cave 2");
    }
}
