#!/usr/bin/env bash
# Shows a server and a worker to real parts: their spans to rotel (an OTLP collector), their metrics to Prometheus.
set -euo pipefail

root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)"

usage() {
  cat <<'TEXT'
usage: server/tests/telemetry.sh [traces | metrics | scrape URL TOKEN-FILE]

traces    a tiny job over a server and a worker that send to rotel: one trace, each span under its parent
metrics   Prometheus scrapes the server of such a job
scrape    Prometheus scrapes URL with the token in a file, of a server that runs already
Without an argument: traces and metrics. What is missing is fetched into a folder that is deleted at the end when
KARST_TEST_INSTALL=1, else what needs it is skipped with one line. BIN says where the programs are (target/release).
TEXT
}

step() { printf '== %s\n' "$*" >&2; }
say() { printf '   %s\n' "$*" >&2; }
fail() {
  printf 'error: %s\n' "$1" >&2
  exit 1
}

bin="${BIN:-$root/target/release}"
work="$(mktemp -d)"
started=()
clean_up() {
  local status=$? process
  # What has ended already is not missed.
  for process in "${started[@]}"; do { kill -KILL "$process" && wait "$process"; } 2>/dev/null || :; done
  if [ "$status" -ne 0 ]; then
    for log in "$work"/*.log; do
      [ -s "$log" ] || continue
      printf -- '-- the end of %s\n' "${log##*/}" >&2
      tail -n 15 "$log" >&2
    done
  fi
  rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

# start NAME COMMAND…: in the background, into NAME.log; its process is in $last.
start() {
  local name="$1"
  shift
  # Emptied before the process exists: whoever waits for a line must not find that of an earlier start.
  : >"$work/$name.log"
  "$@" >"$work/$name.log" 2>&1 &
  last=$!
  started+=("$last")
}

# await SECONDS COMMAND…: until the command succeeds.
await() {
  local left=$(($1 * 10))
  shift
  until "$@" >/dev/null 2>&1; do
    left=$((left - 1))
    [ "$left" -gt 0 ] || return 1
    sleep 0.1
  done
}

free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
may_fetch() { [ "${KARST_TEST_INSTALL:-}" = 1 ]; }

# Sets rotel; false when it is not there and may not be fetched.
find_rotel() {
  rotel="$(command -v rotel-agent || :)"
  [ -z "$rotel" ] || return 0
  may_fetch || return 1
  step "fetch rotel"
  python3 -m venv "$work/venv"
  "$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check rotel==0.0.1a15
  rotel="$(find "$work/venv" -name rotel-agent -type f)"
  [ -x "$rotel" ] || fail "rotel-agent is not in the wheel"
}

# Puts prometheus and promtool on the PATH; false when they are not there and may not be fetched. Taken out of
# Debian's package instead of installed: nothing of the machine changes.
find_prometheus() {
  if command -v prometheus >/dev/null && command -v promtool >/dev/null; then return 0; fi
  may_fetch && command -v apt-get >/dev/null || return 1
  step "fetch prometheus"
  mkdir "$work/debian"
  (cd "$work/debian" && { apt-get download -qq prometheus || { apt-get update -qq && apt-get download -qq prometheus; }; }) \
    >"$work/apt.log" 2>&1
  dpkg -x "$work"/debian/prometheus_*.deb "$work/debian"
  PATH="$work/debian/usr/bin:$PATH"
}

# A server and a worker, with more in their environment; sets url, server, worker and token.
start_farm() {
  local data="$work/data"
  token="$data/token"
  start server env "$@" "$bin/karst-server" serve --listen 127.0.0.1:0 --data "$data" --workers 0
  server=$last
  await 10 grep -q '^listening on ' "$work/server.log" || fail "the server did not come up"
  url="$(sed -n 's/^listening on //p' "$work/server.log")"
  start worker env "$@" "$bin/karst-server" work --server "$url" --token-file "$token" --threads 1 --cache "$work/cache"
  worker=$last
}

submit() {
  "$bin/karst" submit "$root/scenes/cornell.json" --server "$url" --token-file "$token" --size 64x48 --spp 8 --wait \
    -o "$work/out" >"$work/submit.log" 2>&1
}

stop_farm() {
  local process
  for process in "$worker" "$server"; do
    kill "$process"
    wait "$process" || fail "process $process ended with status $?"
  done
}

traces() {
  find_rotel || { echo "skipped: rotel-agent is not installed (KARST_TEST_INSTALL=1 fetches it)" && return; }
  step "traces: rotel takes the spans of a server and a worker"
  local port http
  port="$(free_port)" http="$(free_port)"
  start rotel "$rotel" start --otlp-grpc-endpoint "127.0.0.1:$port" --otlp-http-endpoint "127.0.0.1:$http" \
    --exporter blackhole --debug-log traces --debug-log-verbosity detailed
  await 10 bash -c ": </dev/tcp/127.0.0.1/$port" || fail "rotel did not come up"
  start_farm "OTEL_EXPORTER_OTLP_ENDPOINT=http://127.0.0.1:$port"
  submit
  stop_farm
  await 10 grep -q 'Name           : job' "$work/rotel.log" || fail "no span of a job came"
  python3 - "$work/rotel.log" <<'PYTHON'
import re, sys

spans, service = {}, None
for line in open(sys.argv[1], encoding="utf-8", errors="replace"):
    if line.startswith("Resource attributes"):
        inside = "resource"
    elif re.match(r"Span #\d+", line):
        inside, span = "span", {}
    elif found := re.match(r"\s+-> service\.name: Str\((.*)\)", line):
        service = found[1]
    elif found := re.match(r"\s+(Trace ID|Parent ID|ID|Name)\s*: *(\S*)", line):
        span[found[1]] = found[2]
        if found[1] == "Name":
            span["service"] = service
            spans[span["ID"]] = span
parents = {"job": None, "frame": "job", "round": "frame", "task": "round", "render": "task"}
assert len({span["Trace ID"] for span in spans.values()}) == 1, "more than one trace"
for span in spans.values():
    parent = spans.get(span["Parent ID"], {}).get("Name")
    assert parent == parents[span["Name"]], f"{span} under {parent}"
    expected = "karst-worker" if span["Name"] == "render" else "karst-server"
    assert span["service"] == expected, span
names = [span["Name"] for span in spans.values()]
counts = {name: names.count(name) for name in parents}
assert counts["task"] == counts["render"] >= 1 and counts["round"] == 2 and counts["job"] == 1, counts
print(f"   one trace of {len(spans)} spans: {counts}", file=sys.stderr)
PYTHON
}

# scrape URL TOKEN-FILE [TILES]: Prometheus reads the metrics, and finds at least that many tiles in them.
scrape() {
  local address="$1" token="$2" tiles="${3:-0}"
  find_prometheus || { echo "skipped: prometheus is not installed (KARST_TEST_INSTALL=1 fetches it)" && return; }
  step "metrics: promtool checks and Prometheus scrapes $address/metrics"
  python3 - "$address/metrics" "$token" >"$work/metrics.txt" <<'PYTHON'
import pathlib, sys, urllib.request
token = pathlib.Path(sys.argv[2]).read_text().strip()
request = urllib.request.Request(sys.argv[1], headers={"Authorization": f"Bearer {token}"})
with urllib.request.urlopen(request, timeout=10) as answer:
    kind = answer.headers["Content-Type"]
    assert kind.startswith("text/plain; version=0.0.4"), kind
    sys.stdout.write(answer.read().decode())
PYTHON
  promtool check metrics <"$work/metrics.txt" >"$work/promtool.log" 2>&1 || fail "promtool does not take the metrics"
  [ ! -s "$work/promtool.log" ] || fail "promtool has something to say"
  cat >"$work/prometheus.yml" <<YAML
global: { scrape_interval: 1s }
scrape_configs:
  - job_name: karst
    scheme: ${address%%://*}
    authorization: { credentials_file: $token }
    static_configs: [{ targets: ["${address#*://}"] }]
YAML
  promtool check config "$work/prometheus.yml" >"$work/promtool.log" 2>&1 || fail "promtool does not take the configuration"
  local port
  port="$(free_port)"
  start prometheus prometheus --config.file "$work/prometheus.yml" --storage.tsdb.path "$work/tsdb" \
    --web.listen-address "127.0.0.1:$port" --log.level warn
  await 30 asked "$port" "up == 1 and on(instance) karst_tiles_accepted_total >= $tiles" ||
    fail "Prometheus does not know karst_tiles_accepted_total >= $tiles"
  say "$(grep -vc '^#' "$work/metrics.txt") series, at least $tiles tiles"
}

# asked PORT QUERY: Prometheus has an answer to it.
asked() {
  python3 - "$@" <<'PYTHON'
import json, sys, urllib.parse, urllib.request
query = urllib.parse.urlencode({"query": sys.argv[2]})
with urllib.request.urlopen(f"http://127.0.0.1:{sys.argv[1]}/api/v1/query?{query}", timeout=5) as answer:
    sys.exit(0 if json.load(answer)["data"]["result"] else 1)
PYTHON
}

metrics() {
  start_farm "OTEL_EXPORTER_OTLP_ENDPOINT="
  submit
  scrape "$url" "$token" 2
  stop_farm
}

case "${1:-all}" in
  all) traces && rm -rf "$work/data" "$work/out" && metrics ;;
  traces) traces ;;
  metrics) metrics ;;
  scrape) scrape "${2:?URL}" "${3:?TOKEN-FILE}" ;;
  -h | --help) usage ;;
  *) usage >&2 && fail "$1: no such part" ;;
esac
