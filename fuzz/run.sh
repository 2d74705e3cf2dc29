#!/usr/bin/env bash
# Runs the fuzz targets one after the other, each for the given seconds, and prints what they did.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: fuzz/run.sh SECONDS [TARGET…]

Runs each target (all without a name) for SECONDS and prints a table: executions, new inputs, edges covered, peak
memory. Ends with 1 when a target crashed, hung or asked for too much memory; the inputs are in target/fuzz/found.
FUZZ_SANITIZER=none runs without AddressSanitizer. Needs the nightly compiler and `cargo install cargo-fuzz`.
TEXT
}

case "${1:-}" in
  '' | -h | --help) usage; exit 2 ;;
esac
seconds="$1"
shift
root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)"
cd -- "$root"

# More than any reader needs under the limits in readers.rs; a file that gets past them is a finding.
memory_mb=2048
allocation_mb=512
slowest_seconds=10
largest_bytes=32768
sanitizer="${FUZZ_SANITIZER:-address}"
work="$root/target/fuzz"

if [ $# -gt 0 ]; then targets=("$@"); else targets=(document mitsuba obj ply gltf image); fi
cargo +nightly fuzz --version >/dev/null 2>&1 || {
  echo "missing: cargo-fuzz, or a nightly compiler" >&2
  echo "hint: rustup toolchain install nightly && cargo install cargo-fuzz --locked" >&2
  exit 1
}
# cargo-fuzz sets flags of its own in place of those of .cargo/config.toml.
export RUSTFLAGS="-C target-cpu=x86-64-v3"
mkdir -p "$work/found" "$work/log"
build=(--fuzz-dir fuzz --target-dir "$work/build" --sanitizer "$sanitizer" --release)
cargo +nightly fuzz build "${build[@]}" >&2

statistic() { sed -n "s/^stat::$2: *//p" "$work/log/$1.txt" | tail -n 1; }
coverage() { grep -o 'cov: [0-9]*' "$work/log/$1.txt" | tail -n 1 | cut -d ' ' -f 2; }

bad=0
row='%-10s %12s %10s %8s %9s %9s  %s\n'
# shellcheck disable=SC2059  # the format of every row
printf "$row" target executions per_second new edges peak_mb result
for target in "${targets[@]}"; do
  # What the fuzzer finds stays out of the repository; its corpus there is the start.
  mkdir -p "$work/corpus/$target"
  result=ok
  program="$work/build/x86_64-unknown-linux-gnu/release/$target"
  "$program" "$work/corpus/$target" "fuzz/corpus/$target" \
    -max_total_time="$seconds" -timeout="$slowest_seconds" -max_len="$largest_bytes" \
    -rss_limit_mb="$memory_mb" -malloc_limit_mb="$allocation_mb" \
    -artifact_prefix="$work/found/$target-" -print_final_stats=1 >"$work/log/$target.txt" 2>&1 || result="failed ($?)"
  if [ "$result" != ok ]; then
    bad=1
  fi
  # shellcheck disable=SC2059
  printf "$row" "$target" "$(statistic "$target" number_of_executed_units)" \
    "$(statistic "$target" average_exec_per_sec)" "$(statistic "$target" new_units_added)" \
    "$(coverage "$target")" "$(statistic "$target" peak_rss_mb)" "$result"
done
if [ "$bad" = 1 ]; then
  echo "found:" >&2
  ls -la "$work/found" >&2
fi
exit "$bad"
