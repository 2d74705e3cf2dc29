#!/usr/bin/env bash
# Renders one frame in many ways, some of them rough, and holds the SHA-256 of the files against each other.
set -euo pipefail

root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)"

usage() {
  cat <<'TEXT'
usage: server/tests/same-bits.sh [--bin DIR] [--scene FILE] [--every SECONDS] [-- RENDER SETTINGS…]

Renders the first frame of a scene (scenes/demo/demo.json) with `karst render`, with a server alone, with a server and
1, 2 and 5 worker processes, and with 5 workers of which a random one is killed every 2 seconds (and started again)
and a server that is killed once. One line each: seconds, SHA-256 of the EXR. Exit code 0 when all are the same.
TEXT
}

fail() {
  printf 'error: %s\n' "$1" >&2
  exit 1
}

bin="$root/target/release" scene="$root/scenes/demo/demo.json" every=2 settings=()
while [ $# -gt 0 ]; do
  case "$1" in
    --bin) bin="$(realpath -- "${2:?--bin DIR}")" && shift 2 ;;
    --scene) scene="$(realpath -- "${2:?--scene FILE}")" && shift 2 ;;
    --every) every="${2:?--every SECONDS}" && shift 2 ;;
    --) shift && settings=("$@") && break ;;
    -h | --help) usage && exit 0 ;;
    *) usage >&2 && fail "$1: no such option" ;;
  esac
done

work="$(mktemp -d)"
export XDG_STATE_HOME="$work/state"
server="" url="" workers=()
clean_up() {
  local process
  for process in "${workers[@]}" $server; do kill -9 "$process" 2>/dev/null || :; done
  rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

# start_server NAME LISTEN OPTION…: sets server (process) and url.
start_server() {
  local name="$1" listen="$2"
  shift 2
  : >"$work/$name.stdout"
  "$bin/karst-server" serve --listen "$listen" --data "$work/$name" --lease 5 --log error "$@" \
    >"$work/$name.stdout" 2>>"$work/$name.log" &
  server=$!
  for _ in $(seq 600); do
    url="$(sed -n 's/^listening on //p' "$work/$name.stdout")"
    [ -z "$url" ] || return 0
    kill -0 "$server" 2>/dev/null || break
    sleep 0.1
  done
  fail "the server did not come up: $(tail -n 3 "$work/$name.log")"
}

# A free address that no outgoing connection gets by itself: while a server is away, nobody else takes its port.
quiet_address() {
  local port
  for port in $(shuf -i 20000-32000 -n 50); do
    (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null || { echo "127.0.0.1:$port" && return 0; }
  done
  fail "no free port between 20000 and 32000"
}

start_worker() {
  "$bin/karst-server" work --server "$url" --threads 1 --cache "$work/cache" --log off 2>/dev/null &
  workers[$1]=$!
}

end_all() {
  local process
  for process in "${workers[@]}" $server; do
    kill "$process" 2>/dev/null || :
    wait "$process" 2>/dev/null || :
  done
  workers=() server=""
}

submit() {
  "$bin/karst" submit "$scene" --frame 1 "${settings[@]}" --server "$url" --wait -o "$work/$1.out" \
    >/dev/null 2>"$work/$1.client"
}

differs=0 expected=""
# report NAME SECONDS FILE
report() {
  local sha
  sha="$(sha256sum "$3" | cut -d ' ' -f 1)"
  [ -n "$expected" ] || expected="$sha"
  [ "$sha" = "$expected" ] || differs=1
  printf '%-52s %5d s  %s\n' "$1" "$2" "$sha"
}

begin=$SECONDS
"$bin/karst" render "$scene" --frame 1 "${settings[@]}" -o "$work/local.exr" >/dev/null 2>&1
report "karst render" $((SECONDS - begin)) "$work/local.exr"

begin=$SECONDS
start_server alone 127.0.0.1:0 --workers 2
submit alone || fail "server alone: $(tail -n 3 "$work/alone.client")"
report "server alone" $((SECONDS - begin)) "$work"/alone.out/*.exr
end_all

for count in 1 2 5; do
  begin=$SECONDS
  start_server "with$count" 127.0.0.1:0 --workers 0
  for one in $(seq "$count"); do start_worker "$one"; done
  submit "with$count" || fail "$count workers: $(tail -n 3 "$work/with$count.client")"
  report "server and $count workers" $((SECONDS - begin)) "$work/with$count.out"/*.exr
  end_all
done

begin=$SECONDS kills=0 restarted=0 RANDOM=7
start_server rough "$(quiet_address)" --workers 0
for one in 1 2 3 4 5; do start_worker "$one"; done
submit rough &
client=$!
while kill -0 "$client" 2>/dev/null; do
  sleep "$every"
  one=$((RANDOM % 5 + 1))
  kill -9 "${workers[$one]}" 2>/dev/null || :
  wait "${workers[$one]}" 2>/dev/null || :
  start_worker "$one"
  kills=$((kills + 1))
  if [ "$restarted" = 0 ] && [ "$kills" -ge 5 ]; then
    kill -9 "$server"
    wait "$server" 2>/dev/null || :
    start_server rough "${url#http://}" --workers 0
    restarted=1
  fi
done
wait "$client" || fail "kills: $(tail -n 3 "$work/rough.client")"
report "5 workers, $kills of them killed, $restarted server killed" $((SECONDS - begin)) "$work"/rough.out/*.exr
end_all
[ "$restarted" = 1 ] || fail "the job was over before the server was killed: choose more samples"
[ "$differs" = 0 ] || fail "not the same bits"
