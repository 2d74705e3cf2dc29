#!/usr/bin/env bash
# Starts the manifests' server in podman as it would run in a cluster, waits until it is healthy, looks at it, stops it.
set -euo pipefail

root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)"

usage() {
  cat <<'TEXT'
usage: k8s/play.sh [--python PYTHON] IMAGE

Needs podman, kubectl (or kustomize) and a Python with PyYAML. What is missing is one line `skipped: …`.
TEXT
}

step() { printf '== %s\n' "$*" >&2; }
fail() {
  printf 'error: %s\n' "$1" >&2
  exit 1
}
skip() {
  printf 'skipped: %s\n' "$1"
  exit 0
}

python=python3 image=""
while [ $# -gt 0 ]; do
  case "$1" in
    --python) python="${2:?--python PYTHON}" && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    -*) usage >&2 && fail "$1: no such option" ;;
    *) image="$1" && shift ;;
  esac
done
[ -n "$image" ] || { usage >&2 && fail "IMAGE is missing"; }
command -v podman >/dev/null || skip "podman is not installed"
"$python" -c 'import yaml' 2>/dev/null || skip "PyYAML is not installed"
if command -v kubectl >/dev/null; then
  build=(kubectl kustomize)
elif command -v kustomize >/dev/null; then
  build=(kustomize build)
else
  skip "neither kubectl nor kustomize is installed"
fi

work="$(mktemp -d)"
pod=karst-server-pod-0
one=karst-server-pod-0-server
clean_up() {
  local status=$?
  if [ "$status" -ne 0 ] && podman container exists "$one"; then
    podman logs "$one" 2>&1 | tail -n 20 >&2 || :
  fi
  podman pod rm -f "$pod" >/dev/null 2>&1 || :
  podman volume rm -f karst-server-data karst-tls karst-ca karst-tokens >/dev/null 2>&1 || :
  rm -rf "$work"
}
! podman pod exists "$pod" || fail "a pod $pod is there already: podman pod rm -f $pod"
trap clean_up EXIT
trap 'exit 130' INT TERM

step "secrets"
"$root/docker/secrets.sh" --image "$image" --name karst "$work/secrets" >/dev/null

step "build, convert, play"
"${build[@]}" "$root/k8s/base" >"$work/built.yaml"
"$python" "$root/k8s/play.py" "$image" "$work/secrets" <"$work/built.yaml" >"$work/play.yaml"
podman play kube "$work/play.yaml" >"$work/played" 2>&1 || { cat "$work/played" >&2 && fail "podman did not play the manifests"; }

step "healthy, by the manifests' own probe"
healthy=0
for _ in $(seq 60); do
  [ "$(podman inspect -f '{{.State.Running}}' "$one")" = true ] || fail "the server ended"
  if podman healthcheck run "$one" >/dev/null 2>&1; then healthy=1 && break; fi
  sleep 0.5
done
[ "$healthy" = 1 ] || fail "not healthy after 30 s"

step "user, root, capabilities, memory"
inside() { podman exec "$one" "$@"; }
[ "$(inside id -u)" = 10001 ] || fail "runs as user $(inside id -u), expected 10001"
! inside sh -c ': >/opt/karst/probe' 2>/dev/null || fail "can write to its root"
inside sh -c ': >/data/probe && rm /data/probe && : >/tmp/probe && rm /tmp/probe' || fail "cannot write to /data or /tmp"
[ "$(inside sed -n 's/^CapEff:\t*//p' /proc/1/status)" = 0000000000000000 ] || fail "has capabilities"
[ "$(podman inspect -f '{{.HostConfig.Memory}}' "$one")" = 4294967296 ] || fail "has no limit of memory"

step "stop"
begin=$SECONDS
podman stop -t 30 "$one" >/dev/null
[ $((SECONDS - begin)) -le 10 ] || fail "took $((SECONDS - begin)) s to end, at most 10 are allowed"
status="$(podman inspect -f '{{.State.ExitCode}}' "$one")"
[ "$status" = 0 ] || fail "ended with $status after SIGTERM, expected 0"
echo "played: healthy, user 10001, read-only root, no capabilities, stopped in $((SECONDS - begin)) s"
