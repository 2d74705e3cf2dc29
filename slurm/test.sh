#!/usr/bin/env bash
# Renders films on a real Slurm cluster of three nodes, loses a node on the way, and compares every frame's hash.
set -euo pipefail

here="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)"

usage() {
  cat <<'TEXT'
usage: slurm/test.sh [--short|--long] [--bin DIR]

Starts Slurm on this computer (slurm/test/cluster.sh), renders frames by an array and through pilots, and compares
them with `karst render`. --short (the default) takes about a minute; --long adds time limits that are reached, a node
that is lost while a frame goes on there beside its second start, and one that is lost under a pilot.
Programs come from target/release, or from DIR. Without Slurm it says so and succeeds; KARST_TEST_INSTALL=1 lets it
install Slurm with apt.
TEXT
}

step() { printf '== %s\n' "$*" >&2; }
say() { printf '   %s\n' "$*" >&2; }
fail() {
  printf 'error: %s\n' "$1" >&2
  exit 1
}

long=0 bin="$(dirname "$here")/target/release"
while [ $# -gt 0 ]; do
  case "$1" in
    --short) long=0 && shift ;;
    --long) long=1 && shift ;;
    --bin) bin="$(realpath -- "${2:?--bin DIR}")" && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    *) usage >&2 && fail "$1: no such option" ;;
  esac
done
for program in karst karst-server; do
  [ -x "$bin/$program" ] || fail "$bin/$program is missing: ./run build"
done
karst="$bin/karst" scene="$here/test/ball.json"

work="$(mktemp -d)"
server=""
clean_up() {
  local status=$?
  trap - EXIT INT TERM
  if [ "$status" != 0 ] && [ -d "$work/cluster/log" ]; then
    { timeout 5 sinfo -N -l && timeout 5 squeue -l; } >&2 || :
    tail -n 15 "$work"/cluster/log/slurmctld.log "$work"/*/logs/*.log "$work"/*.log >&2 2>/dev/null || :
  fi
  [ ! -f "$work/cluster/slurm.conf" ] || "$here/test/cluster.sh" down "$work/cluster" || status=1
  [ -z "$server" ] || kill "$server" 2>/dev/null || :
  [ -z "$server" ] || wait "$server" 2>/dev/null || :
  [ -n "${KEEP:-}" ] || rm -rf "$work"
  exit "$status"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

said=0
"$here/test/cluster.sh" up "$work/cluster" 2>"$work/up.txt" || said=$?
if [ "$said" = 69 ]; then
  say "skipped: $(sed 's/^error: //' "$work/up.txt")"
  exit 0
fi
[ "$said" = 0 ] || fail "the cluster did not come up: $(cat "$work/up.txt")"
step "a cluster of three nodes: up after $SECONDS s"
export SLURM_CONF="$work/cluster/slurm.conf" XDG_STATE_HOME="$work/state" PATH="$bin:$PATH" TMPDIR="$work/tmp"
unset KARST_SERVER KARST_TOKEN_FILE KARST_CA_FILE
mkdir "$TMPDIR"
cd "$work"

# until_true SECONDS WHAT COMMAND…: waits for it.
until_true() {
  local end=$((SECONDS + $1)) what="$2"
  shift 2
  until "$@"; do
    [ "$SECONDS" -lt "$end" ] || fail "waited in vain until $what"
    sleep 0.3
  done
}

# state_of JOB: fields that scontrol says about a job, one a line.
state_of() { scontrol show job "$1" | tr ' ' '\n' | grep -E '^(JobState|ExitCode|Restarts|Reason)=' | sort -u; }
has_state() { state_of "$1" 2>/dev/null | grep -qxF "$2"; }
# must_have JOB FIELD=VALUE…, must_say FILE TEXT…, nothing_in FOLDER: what is so, or the test fails.
must_have() {
  local job="$1" wanted
  shift
  for wanted in "$@"; do has_state "$job" "$wanted" || fail "job $job: expected $wanted, found $(state_of "$job")"; done
}
must_say() {
  local file="$1" wanted
  shift
  for wanted in "$@"; do grep -q -- "$wanted" "$file" || fail "$file does not say \"$wanted\": $(cat "$file")"; done
}
nothing_in() { [ -z "$(find "$1" -mindepth 1)" ] || fail "something was left: $(find "$1" -mindepth 1)"; }
# has_begun LOG TIMES: as the log says.
has_begun() { grep -qs "start $2," "$1"; }

# same FOLDER REFERENCE: every frame has the bytes of its reference, and there are no others.
same() {
  local count=0 file name
  for file in "$2".*.exr; do
    name="$(basename "$file")"
    cmp -s "$file" "$1/ball.${name#*.}" || fail "$1/ball.${name#*.} differs from $file"
    count=$((count + 1))
  done
  [ "$(find "$1" -maxdepth 1 -name '*.exr' | wc -l)" = "$count" ] || fail "$1 has other frames than $2"
  [ -z "$(find "$1" -maxdepth 1 -name '.karst-*')" ] || fail "$1 has files that nobody finished"
  say "$count frames, sha256 of all: $(cat "$1"/ball.*.exr | sha256sum | cut -c 1-16)…, as rendered without Slurm"
}

step "reference: karst render, 8 frames"
spp=8
"$karst" render "$scene" -o "$work/local.exr" --frames 1-8 --spp "$spp" 2>/dev/null >&2

step "an array of frames, one of which is complete"
"$karst" slurm render "$scene" -o film --frame 3 --spp "$spp" >/dev/null 2>&1
before="$(stat -c %i film/ball.0003.exr)"
job="$("$karst" slurm frames "$scene" -o film --frames 1-4 --spp "$spp" -- --wait -c 1 2>/dev/null)"
logs="$(find film/logs -type f -printf '%f\n' | sort | tr '\n' ' ')"
[ "$logs" = "${job}_1.log ${job}_2.log ${job}_4.log " ] || fail "expected tasks 1, 2 and 4 of $job, found $logs"
job="$(sbatch --parsable --wait --array=3-8 -c 2 -o film/logs/%A_%a.log "$here/frames.sbatch" "$scene" -o film --spp "$spp")"
[ "$(stat -c %i film/ball.0003.exr)" = "$before" ] || fail "a complete frame was rendered again"
must_say "film/logs/${job}_3.log" 'frame 3 is complete'
must_say "film/logs/${job}_5.log" 'frame 5, 2 threads'
same film local

step "what is missing is rendered, and nothing else"
missing() { "$karst" slurm missing "$scene" -o film --spp "$spp" 2>/dev/null; }
[ -z "$(missing)" ] || fail "missing: found $(missing), expected nothing"
rm film/ball.0005.exr
truncate -s -1 film/ball.0007.exr
[ "$(missing)" = 5,7 ] || fail "missing: found $(missing), expected 5,7"
[ "$("$karst" slurm missing "$scene" -o film --spp 9 2>/dev/null)" = 1-8 ] || fail "other settings, and not all frames are missing"
sbatch --parsable --wait --array="$(missing)" -o film/logs/%A_%a.log "$here/frames.sbatch" "$scene" -o film --spp "$spp" >/dev/null
same film local

step "what cannot work fails once, and says why"
# refused WHAT TEXT ARGUMENT…: the array fails at once, its log has the text.
refused() {
  local what="$1" text="$2" job
  shift 2
  job="$(sbatch --parsable --array=1 -o "$work/refused.log" "$here/frames.sbatch" "$@")"
  until_true 20 "$what has failed" has_state "${job}_1" JobState=FAILED
  must_have "${job}_1" Restarts=0
  must_say "$work/refused.log" "$text"
  say "$what: FAILED, $(state_of "${job}_1" | grep ^ExitCode), $(grep -m 1 '^error' "$work/refused.log")"
  rm "$work/refused.log"
}
refused "a missing scene" 'nowhere.json: No such file' "$work/nowhere.json" -o film
refused "a folder that cannot be written to" 'ball.json/film' "$scene" -o "$scene/film"
refused "a frame that the scene lacks" 'the scene has frames 1 to 8' --shift 100 "$scene" -o film
! "$karst" slurm frames "$work/nowhere.json" -o film 2>/dev/null || fail "a missing scene was submitted"

step "the time limit of a frame that takes too long"
job="$(sbatch --parsable --array=1 -c 1 -o slow.log "$here/frames.sbatch" --restarts 1 "$scene" -o slow --spp 100000)"
for start in 1 2; do
  until_true 40 "start $start" has_begun slow.log "$start"
  sleep 1
  scancel --batch --signal=USR1 "$job"
done
until_true 30 "the frame was given up" has_state "${job}_1" JobState=FAILED
must_say slow.log 'goes back to the queue' 'not finished in 2 starts'
must_have "${job}_1" Restarts=1
nothing_in slow
nothing_in "$TMPDIR"
say "started again once, then FAILED with what to do"

step "a server without threads, three pilots"
mkfifo "$work/says"
"$bin/karst-server" serve --listen 127.0.0.1:0 --data "$work/data" --workers 0 --lease 5 --log warn >"$work/says" 2>"$work/server.log" &
server=$!
read -r _ _ url <"$work/says"
status() { "$karst" slurm status --server "$url" --json | python3 -c "import json, sys; print(json.load(sys.stdin)['$1'])"; }
runs() { [ "$(status workers)" = "$1" ]; }
pilots="$("$karst" slurm up --server "$url" --workers 3 -- --ntasks-per-node=1 --exclusive -o pilot-%a.log 2>/dev/null)"
until_true 30 "three pilots run" runs 3
nodes="$("$karst" slurm status --server "$url" | awk '$2 == "RUNNING" { print $3 }' | sort | tr '\n' ' ')"
[ "$nodes" = "n1 n2 n3 " ] || fail "expected a pilot on each node, found $nodes"

# through NAME FRAMES SPP: submits the film to the server and fetches it, in the background; `wait $client` ends it.
through() {
  "$karst" submit "$scene" --server "$url" --frames "$2" --spp "$3" --wait -o "$1" >/dev/null 2>"$work/$1.log" &
  client=$!
}
# still_renders WHAT: the film of `through` was not finished when this happened.
still_renders() { kill -0 "$client" || fail "the film was finished before $1: it needs more samples"; }
step "a film through the pilots; one is requeued"
# Several seconds of work, so that the film goes on while the pilot is away.
longer=200
"$karst" render "$scene" -o "$work/longer.exr" --frames 1-8 --spp "$longer" 2>/dev/null >&2
through served 1-8 "$longer"
sleep 2
! grep -q 'not heard of' server.log || fail "a pilot that waits for work is called lost: $(cat server.log)"
scontrol requeue "${pilots}_1"
still_renders "a pilot was requeued"
until_true 30 "the pilot begins again" has_begun pilot-1.log 2
wait "$client" || fail "the job did not finish: $(tail -n 5 "$work/served.log")"
same served longer

step "the time limit of a pilot: back to the queue while there is work, and only then"
through more 1 100000
sleep 1
scancel --batch --signal=USR1 "${pilots}_2"
until_true 30 "the pilot begins again" has_begun pilot-2.log 2
must_say pilot-2.log 'back to the queue'
must_have "${pilots}_0" Restarts=0
must_have "${pilots}_1" Restarts=1
"$karst" cancel "$("$karst" jobs --server "$url" --state running --json | python3 -c 'import json, sys; print(json.loads(sys.stdin.readline())["id"])')" --server "$url" >/dev/null 2>&1
! wait "$client" || fail "a cancelled job was called finished"
scancel --batch --signal=USR1 "${pilots}_0"
until_true 30 "the pilot has ended" has_state "${pilots}_0" JobState=COMPLETED
must_say pilot-0.log 'the server has no work'

step "what must not be tried again"
printf 'nonsense\n' >"$work/wrong.token"
job="$("$karst" slurm up --server "$url" --workers 1 --token-file "$work/wrong.token" -- -o wrong.log 2>/dev/null)"
until_true 30 "a wrong token is refused" has_state "${job}_0" JobState=FAILED
must_have "${job}_0" ExitCode=77:0 Restarts=0

step "status and down"
runs 2 || fail "expected two pilots, found $("$karst" slurm status --server "$url")"
runs_elsewhere="$("$karst" slurm status --server http://127.0.0.1:9 --json 2>/dev/null)"
grep -q '"workers":0' <<<"$runs_elsewhere" || fail "pilots of another server were found: $runs_elsewhere"
none() { [ "$(status workers) $(status waiting)" = "0 0" ]; }
"$karst" slurm down --server "$url" >/dev/null
until_true 40 "no pilot runs or waits" none
for index in 1 2; do
  must_have "${pilots}_$index" JobState=COMPLETED ExitCode=0:0
done
nothing_in "$TMPDIR"
say "both ended with 0, nothing is left"

# What is longer, in the order in which nodes are lost.

# node_of JOB: where it runs.
node_of() { squeue -h -j "$1" -t RUNNING -o %N | head -n 1; }
frames_done() { [ "$(grep -c '^frame 1:' "$1")" = "$2" ]; }

lost_under_a_frame() {
  step "a node is lost, and the frame on it goes on beside its second start"
  local job log node begin orphans
  job="$("$karst" slurm frames "$scene" -o double --frames 1-1 --spp 2000 -- -c 1 2>/dev/null)"
  log="double/logs/${job}_1.log"
  until_true 20 "the frame is rendered" has_begun "$log" 1
  until_true 20 "the frame is rendered" grep -q rendering "$log"
  node="$(node_of "$job")" begin=$SECONDS
  mapfile -t orphans < <("$here/test/cluster.sh" lose "$work/cluster" "$node")
  # However fast this computer is, the first start goes on when the second has begun.
  kill -STOP "${orphans[@]}"
  until_true 120 "the frame begins again" has_begun "$log" 2
  frames_done "$log" 0 || fail "the first start had ended: nothing ran twice"
  kill -CONT "${orphans[@]}"
  say "$node is lost; the second start came after $((SECONDS - begin)) s"
  until_true 400 "both starts have ended" frames_done "$log" 2
  until_true 20 "the job has ended" has_state "${job}_1" JobState=COMPLETED
  "$karst" render "$scene" -o "$work/twice.exr" --frames 1-1 --spp 2000 2>/dev/null >&2
  same double twice
  [ -z "$("$karst" slurm missing "$scene" -o double --frames 1-1 --spp 2000 2>/dev/null)" ] || fail "the frame is not complete"
}

# A real time limit: Slurm counts in minutes, and its signal may come early.
limit_of_a_pilot() {
  step "Slurm's own time limit: a pilot is back before its job is over"
  "$karst" slurm up --server "$url" --workers 1 -- -c 1 --time=2 -o limit.log >/dev/null 2>&1
  until_true 30 "the pilot runs" runs 1
  through limited 1-1 100000
  until_true 180 "the pilot begins again" has_begun limit.log 2
  must_say limit.log 'back to the queue'
  kill "$client"
  wait "$client" || :
  cancel_all
  "$karst" slurm down --server "$url" >/dev/null
  until_true 40 "no pilot runs or waits" none
}

cancel_all() {
  local job
  for job in $("$karst" jobs --server "$url" --state running --state queued --json | python3 -c 'import json, sys
for line in sys.stdin: print(json.loads(line)["id"])'); do
    "$karst" cancel "$job" --server "$url" >/dev/null 2>&1
  done
}

lost_under_a_pilot() {
  step "a film of a minute through three pilots: one is requeued, one loses its node"
  local job node begin=$SECONDS
  "$karst" render "$scene" -o "$work/minute.exr" --frames 1-8 --spp 900 2>/dev/null >&2
  say "karst render took $((SECONDS - begin)) s"
  job="$("$karst" slurm up --server "$url" --workers 3 -- --exclusive -o again-%a.log 2>/dev/null)"
  until_true 30 "three pilots run" runs 3
  begin=$SECONDS
  through minute-served 1-8 900
  sleep 5
  scontrol requeue "${job}_0"
  still_renders "a pilot was requeued"
  node="$(node_of "${job}_2")"
  "$here/test/cluster.sh" lose "$work/cluster" "$node" >/dev/null
  still_renders "a node was lost"
  wait "$client" || fail "the job did not finish: $(tail -n 5 "$work/minute-served.log")"
  say "finished after $((SECONDS - begin)) s"
  same minute-served minute
  until_true 20 "the pilot that was requeued begins again" has_begun again-0.log 2
  until_true 120 "its pilot waits" waits "${job}_2"
  # In the place of another.
  scancel "${job}_1"
  until_true 60 "its pilot begins again" has_begun again-2.log 2
  "$karst" slurm down --server "$url" >/dev/null
  until_true 40 "no pilot runs or waits" none
}
# A task that waits again shows up beside its array.
waits() { squeue -h -r -t PENDING -o %K -j "${1%_*}" | grep -qxF "${1#*_}"; }

if [ "$long" = 1 ]; then
  limit_of_a_pilot
  lost_under_a_pilot
  lost_under_a_frame
fi
step "all as it should be, in $SECONDS s"
