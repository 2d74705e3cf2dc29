//! Owns the start-up check of the processor: karst is built for x86-64-v3 and says so where it cannot run.

/// What the processor lacks of x86-64-v3, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "this processor lacks {missing}, which this build of karst needs (x86-64-v3: AVX2, FMA, BMI2, F16C)\n  \
     hint: build it on this machine with RUSTFLAGS=\"-C target-cpu=native\""
)]
pub struct UnsupportedCpu {
    /// Names of the missing instruction sets, comma separated.
    pub missing: String,
}

/// Checks that the processor has every instruction set that the build assumes.
///
/// # Errors
/// Names the missing instruction sets.
#[cfg(target_arch = "x86_64")]
pub fn require_baseline() -> Result<(), UnsupportedCpu> {
    use std::arch::x86_64::{__cpuid, __cpuid_count};
    // The compiler folds `is_x86_feature_detected!` to true for features the build assumes, so ask the processor.
    let max_leaf = __cpuid(0).eax;
    let basic = __cpuid(1).ecx;
    let extended = if max_leaf >= 7 { __cpuid_count(7, 0).ebx } else { 0 };
    let wanted = [
        ("FMA", cfg!(target_feature = "fma"), basic >> 12 & 1),
        ("SSE4.2", cfg!(target_feature = "sse4.2"), basic >> 20 & 1),
        ("MOVBE", cfg!(target_feature = "movbe"), basic >> 22 & 1),
        ("AVX", cfg!(target_feature = "avx"), basic >> 28 & 1),
        ("F16C", cfg!(target_feature = "f16c"), basic >> 29 & 1),
        ("BMI1", cfg!(target_feature = "bmi1"), extended >> 3 & 1),
        ("AVX2", cfg!(target_feature = "avx2"), extended >> 5 & 1),
        ("BMI2", cfg!(target_feature = "bmi2"), extended >> 8 & 1),
    ];
    let missing: Vec<&str> =
        wanted.iter().filter(|(_, assumed, has)| *assumed && *has == 0).map(|(name, ..)| *name).collect();
    if missing.is_empty() { Ok(()) } else { Err(UnsupportedCpu { missing: missing.join(", ") }) }
}

/// Other processors run the portable build, which assumes nothing.
///
/// # Errors
/// None on this architecture.
#[cfg(not(target_arch = "x86_64"))]
pub fn require_baseline() -> Result<(), UnsupportedCpu> {
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_machine_that_runs_the_tests_passes() {
        assert_eq!(super::require_baseline(), Ok(()));
    }
}
