//! Tells `karst-oidn` where the OIDN libraries lie, relative to itself: in the source tree and in an installation.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_OIDN").is_none() {
        return;
    }
    for folder in ["$ORIGIN/../../third_party/oidn/lib", "$ORIGIN/../lib"] {
        println!("cargo:rustc-link-arg-bins=-Wl,-rpath,{folder}");
    }
}
