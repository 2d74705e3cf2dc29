//! Compiles the protos with protox (no `protoc`) and keeps their descriptors for reflection.

use std::error::Error;
use std::path::PathBuf;
use std::{env, fs};

use prost::Message;

const FILES: [&str; 6] = [
    "karst/v1/assets.proto",
    "karst/v1/common.proto",
    "karst/v1/frames.proto",
    "karst/v1/jobs.proto",
    "karst/v1/previews.proto",
    "karst/v1/workers.proto",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=karst");
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let descriptors = protox::compile(FILES, ["."])?;
    fs::write(out.join("karst.v1.descriptors"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure().bytes(".").compile_fds(descriptors)?;
    Ok(())
}
