#!/usr/bin/env bash
# Runs a server and two workers as containers that share nothing but a network, renders a scene, says its hash.
set -euo pipefail

root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)"

usage() {
  cat <<'TEXT'
usage: docker/test.sh [--image NAME] [--engine podman|docker] [--build-arg KEY=VALUE…] [--scene FILE] [--frame N] [--expect SHA256]

Without --image, builds karst:test first, with the build arguments given. Of the scene (scenes/cornell.json) one frame
is rendered (1); its EXR's sha256 is printed, and held against --expect. Exit code 0 when everything was as it should be.
TEXT
}

step() { printf '== %s\n' "$*" >&2; }
say() { printf '   %s\n' "$*" >&2; }
fail() {
  printf 'error: %s\n' "$1" >&2
  exit 1
}

image="" engine=podman scene="$root/scenes/cornell.json" frame=1 expect="" build_args=()
while [ $# -gt 0 ]; do
  case "$1" in
    --image) image="${2:?--image NAME}" && shift 2 ;;
    --engine) engine="${2:?--engine podman|docker}" && shift 2 ;;
    --scene) scene="$(realpath -- "${2:?--scene FILE}")" && shift 2 ;;
    --frame) frame="${2:?--frame N}" && shift 2 ;;
    --expect) expect="${2:?--expect SHA256}" && shift 2 ;;
    --build-arg) build_args+=(--build-arg "${2:?--build-arg KEY=VALUE}") && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    *) usage >&2 && fail "$1: no such option" ;;
  esac
done
command -v "$engine" >/dev/null || { echo "skipped: $engine is not installed" && exit 0; }

name="karst-test-$$"
work="$(mktemp -d)"
clean_up() {
  local status=$?
  if [ "$status" -ne 0 ]; then
    for one in server worker1 worker2; do
      printf -- '-- the end of what %s said\n' "$one" >&2
      "$engine" logs "$name-$one" 2>&1 | tail -n 20 >&2 || :
    done
  fi
  "$engine" rm -f -v "$name-server" "$name-worker1" "$name-worker2" >/dev/null 2>&1 || :
  "$engine" network rm "$name" >/dev/null 2>&1 || :
  "$engine" volume rm "$name" >/dev/null 2>&1 || :
  rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

if [ -z "$image" ]; then
  image="karst:test"
  step "build $image"
  # Podman keeps a HEALTHCHECK only in this format, which is the only one that docker has.
  format=() && [ "$engine" != podman ] || format=(--format docker)
  "$engine" build "${format[@]}" "${build_args[@]}" -t "$image" -f "$root/docker/Dockerfile" "$root" >&2
fi

# The rules of every container: nothing of the machine, nothing to write to but what is named.
rules=(--no-healthcheck --read-only --tmpfs /tmp --cap-drop ALL --security-opt no-new-privileges --pids-limit 256)
ca=/etc/karst/tls/cert.pem

step "secrets"
secrets="$("$root/docker/secrets.sh" --engine "$engine" --image "$image" --name karst "$work/secrets")"

step "network without a way out, volume, server"
"$engine" network create --internal "$name" >/dev/null
"$engine" volume create "$name" >/dev/null
"$engine" run -d --name "$name-server" --network "$name" "${rules[@]}" --memory 4g --cpus 2 \
  -v "$name:/data" -v "$secrets/tls:/etc/karst/tls:ro" -v "$secrets/tokens:/etc/karst/tokens:ro" \
  -e KARST_WORKERS=0 -e KARST_TLS_CERT="$ca" -e KARST_TLS_KEY=/etc/karst/tls/key.pem \
  -e KARST_TOKENS_FILE=/etc/karst/tokens "$image" serve >/dev/null

health() { "$engine" exec "$name-server" karst-server health --server https://localhost:7878 --ca-file "$ca" >/dev/null 2>&1; }
for _ in $(seq 60); do
  health && break
  [ "$("$engine" inspect -f '{{.State.Running}}' "$name-server")" = true ] || fail "the server ended"
  sleep 0.5
done
health || fail "the server is not healthy after 30 s"
address="$("$engine" inspect -f '{{range .NetworkSettings.Networks}}{{.IPAddress}}{{end}}' "$name-server")"
say "healthy at $address"

# caller ROLE: options of a container that calls the server as that role.
caller() {
  printf '%s\n' --network "$name" --add-host "karst:$address" "${rules[@]}" \
    -v "$secrets/tls/cert.pem:$ca:ro" -v "$secrets/$1.token:/etc/karst/token:ro" \
    -e KARST_SERVER=https://karst:7878 -e KARST_CA_FILE="$ca" -e KARST_TOKEN_FILE=/etc/karst/token
}
mapfile -t as_worker < <(caller work)
mapfile -t as_client < <(caller submit)

step "two workers"
for one in worker1 worker2; do
  "$engine" run -d --name "$name-$one" "${as_worker[@]}" --memory 2g --cpus 1 -v /cache \
    "$image" work >/dev/null
done

step "each is alone, and nobody in particular"
namespaces=""
for one in server worker1 worker2; do
  inside() { "$engine" exec "$name-$one" "$@"; }
  [ "$(inside id -u)" = 10001 ] || fail "$one runs as user $(inside id -u), expected 10001"
  [ "$(inside sed -n 's/^CapEff:\t*//p' /proc/1/status)" = 0000000000000000 ] || fail "$one has capabilities"
  [ "$(inside sed -n 's/^NoNewPrivs:\t*//p' /proc/1/status)" = 1 ] || fail "$one can gain privileges"
  ! inside sh -c ': >/opt/karst/probe' 2>/dev/null || fail "$one can write to its root"
  namespaces+="$(inside readlink /proc/1/ns/net)"$'\n'
done
[ "$(printf %s "$namespaces" | sort -u | wc -l)" = 3 ] || fail "containers share a network namespace"
say "user 10001, no capabilities, read-only root, three network namespaces"

step "what must be refused"
said="$("$engine" run --rm --network none "${rules[@]}" -v /data "$image" serve 2>&1)" &&
  fail "a server without TLS listens on every address"
grep -qi tls <<<"$said" || fail "a server without TLS does not say why it refuses: $said"
echo nonsense >"$work/wrong.token" && chmod 0644 "$work/wrong.token"
status=0
"$engine" run --rm "${as_worker[@]}" -v "$work/wrong.token:/etc/karst/wrong:ro" -e KARST_TOKEN_FILE=/etc/karst/wrong \
  -v /cache "$image" work >/dev/null 2>&1 || status=$?
[ "$status" = 77 ] || fail "a worker with a wrong token ends with $status, expected 77"
say "no TLS, no token: refused"

step "submit $(basename "$scene")"
mkdir "$work/out"
begin=$(date +%s%N)
# As whoever calls this script, so that the pictures are theirs.
"$engine" run --rm --init --user "$(id -u):$(id -g)" "${as_client[@]}" -v "$(dirname "$scene"):/scenes:ro" -v "$work/out:/out" \
  --entrypoint karst "$image" submit "/scenes/$(basename "$scene")" --frame "$frame" --wait -o /out >&2
say "$((($(date +%s%N) - begin) / 1000000)) ms from submit to the picture"
pictures=("$work"/out/*.exr)
if [ ${#pictures[@]} != 1 ] || [ ! -s "${pictures[0]}" ]; then fail "expected one EXR, found: ${pictures[*]}"; fi
sha="$(sha256sum "${pictures[0]}" | cut -d ' ' -f 1)"

step "stop"
# stopped CONTAINER SECONDS: ends by itself on SIGTERM, within that time, with 0.
stopped() {
  local begin=$SECONDS
  "$engine" stop -t "$(($2 + 5))" "$name-$1" >/dev/null
  [ $((SECONDS - begin)) -le "$2" ] || fail "$1 took $((SECONDS - begin)) s to end, at most $2 are allowed"
  local status
  status="$("$engine" inspect -f '{{.State.ExitCode}}' "$name-$1")"
  [ "$status" = 0 ] || fail "$1 ended with $status after SIGTERM, expected 0"
}
stopped worker1 30
stopped worker2 30
stopped server 10
say "workers and server ended by themselves with 0"

printf '%s  %s\n' "$sha" "$(basename "${pictures[0]}")"
[ -z "$expect" ] || [ "$sha" = "$expect" ] || fail "the picture has sha256 $sha, expected $expect"
