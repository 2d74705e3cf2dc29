#!/usr/bin/env bash
# Shows the live page in a real browser while a job is rendered, and checks what is on the screen.
set -euo pipefail

root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)"

usage() {
  cat <<'TEXT'
usage: server/page/test.sh [--bin DIR] [--within SECONDS] [--screenshot FILE]

Starts a server, opens its page in Chromium, submits scenes/cornell.json and runs check.py: first pixels within
SECONDS (1 unless given), a picture that keeps changing, exposure as computed, a probe that equals the floats of the
same frame rendered without a server. Programs are taken from DIR (target/release).
TEXT
}

say() { printf '   %s\n' "$*" >&2; }
skip() {
  echo "skipped: $1"
  exit 0
}

bin="$root/target/release" within=1 screenshot=()
while [ $# -gt 0 ]; do
  case "$1" in
    --bin) bin="${2:?--bin DIR}" && shift 2 ;;
    --within) within="${2:?--within SECONDS}" && shift 2 ;;
    --screenshot) screenshot=(--screenshot "${2:?--screenshot FILE}") && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    *) usage >&2 && exit 2 ;;
  esac
done

# Chromium, and a Python of our own with what drives it and what reads an EXR.
if ! command -v chromium >/dev/null; then
  [ "${KARST_TEST_INSTALL:-}" = 1 ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null ||
    skip "the page in a browser: chromium is not installed (apt-get install -y chromium)"
  say "install: chromium"
  apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium >/dev/null
fi
venv="$root/target/page-venv"
if [ ! -e "$venv/ready" ]; then
  [ "${KARST_TEST_INSTALL:-}" = 1 ] ||
    skip "the page in a browser: no Python with playwright (KARST_TEST_INSTALL=1 makes one in target/)"
  say "install: playwright and OpenEXR into target/page-venv"
  python3 -m venv --without-pip "$venv"
  python3 -m pip --python "$venv/bin/python" install --quiet --disable-pip-version-check playwright==1.65.2 OpenEXR==3.5.3
  touch "$venv/ready"
fi

work="$(mktemp -d)"
server=""
clean_up() {
  [ -z "$server" ] || kill "$server" 2>/dev/null || :
  rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

settings=(scenes/cornell.json --size 320x180 --spp 64)
cd -- "$root"
# The same bits, before the browser needs the processors.
"$bin/karst" render "${settings[@]}" -o "$work/local.exr" >/dev/null 2>&1
"$venv/bin/python" - "$work/local.exr" >"$work/values.json" <<'PYTHON'
import json, sys
import OpenEXR

channels = OpenEXR.File(sys.argv[1], separate_channels=True).channels()
at = lambda name, x, y: float(channels[name].pixels[y][x])
layers = {"Color": ["R", "G", "B"], "Albedo": ["Albedo.R", "Albedo.G", "Albedo.B"]}
pixels = [(100, 20), (160, 90), (319, 179)]
print(json.dumps([{"x": x, "y": y, **{layer: [at(n, x, y) for n in names] for layer, names in layers.items()}} for x, y in pixels]))
PYTHON

export XDG_STATE_HOME="$work/state"
"$bin/karst-server" serve --listen 127.0.0.1:0 --data "$work/data" --log warn >"$work/stdout" &
server=$!
for _ in $(seq 100); do
  url="$(sed -n 's/^listening on //p' "$work/stdout")"
  [ -z "$url" ] || break
  sleep 0.1
done
"$venv/bin/python" server/page/check.py --url "$url" --token "$(cat "$work/data/token")" --within "$within" \
  --submit "$bin/karst submit ${settings[*]} --server $url" --exr-values "$work/values.json" "${screenshot[@]}"
