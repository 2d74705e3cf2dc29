//! Names the build of the core: two programs with the same name give the same bits for the same scene.
//!
//! Everything that can change a bit goes in: the sources, the locked dependencies, the compiler, the instruction sets.

#![allow(clippy::disallowed_methods, reason = "cargo tells build scripts everything through the environment")]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let lock = Path::new("../Cargo.lock");
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rerun-if-changed={}", lock.display());
    let mut files = Vec::new();
    collect(Path::new("src"), &mut files)?;
    files.sort();
    files.extend(lock.exists().then(|| lock.to_owned()));
    let mut hash = Fnv::new();
    for file in files {
        hash.add(file.to_string_lossy().as_bytes());
        hash.add(&fs::read(&file)?);
    }
    hash.add(env::var("CARGO_CFG_TARGET_FEATURE").unwrap_or_default().as_bytes());
    hash.add(&[u8::from(env::var_os("CARGO_CFG_KARST_PLAIN").is_some())]);
    hash.add(env::var("TARGET").unwrap_or_default().as_bytes());
    let rustc = env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    hash.add(&Command::new(rustc).arg("-vV").output()?.stdout);
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    println!("cargo::rustc-env=KARST_CORE_BUILD={version}+{:016x}", hash.0);
    Ok(())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    Ok(())
}

/// FNV-1a, 64 bits: the name must differ when something differs by accident, nobody attacks it.
struct Fnv(u64);

impl Fnv {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, bytes: &[u8]) {
        // The length keeps neighbours apart: "ab" + "c" is not "a" + "bc".
        for byte in (bytes.len() as u64).to_le_bytes().iter().chain(bytes) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
