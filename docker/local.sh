#!/usr/bin/env bash
# Builds the image without a registry out of the programs in target/release, runs a farm of containers and a pod of it.
set -euo pipefail

root="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)"

usage() {
  cat <<'TEXT'
usage: docker/local.sh

Makes a base (docker/base.sh) and a store for podman in target/containers, builds karst:test, and runs docker/test.sh,
which must give the very picture that `karst render` gives, and k8s/play.sh. Needs root on Debian 12 or newer; what is
missing is one line `skipped: …`, or installed with apt when KARST_TEST_INSTALL=1.
TEXT
}

step() { printf '== %s\n' "$*" >&2; }
skip() {
  printf 'skipped: the image: %s\n' "$1"
  exit 0
}

[ $# = 0 ] || { usage && exit "$([[ "$1" = -h || "$1" = --help ]] && echo 0 || echo 1)"; }
[ "$(id -u)" = 0 ] || skip "it takes root to make a base without a registry"
grep -qx ID=debian /etc/os-release || skip "the programs built here run in a base of the same release, which is made on Debian only"

packages="podman runc debootstrap netavark iptables catatonit"
is_complete() {
  local program
  for program in podman runc debootstrap iptables; do command -v "$program" >/dev/null || return 1; done
}
if ! is_complete; then
  [ "${KARST_TEST_INSTALL:-}" = 1 ] || skip "podman or debootstrap is not installed (apt-get install -y --no-install-recommends $packages)"
  step "install: $packages"
  apt-get -o DPkg::Lock::Timeout=300 update -qq
  # shellcheck disable=SC2086  # a list of names without spaces
  DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 install -y -qq --no-install-recommends $packages >/dev/null
fi

store="$root/target/containers"
clean_up() {
  # Podman leaves its store mounted, and `cargo clean` could not delete it.
  umount "$store/store/overlay" 2>/dev/null || :
  rm -rf "$work"
}
work="$(mktemp -d)"
trap clean_up EXIT
trap 'exit 130' INT TERM

base="$("$root/docker/base.sh" "$store")"
# shellcheck disable=SC1091  # written by base.sh
source "$store/env.sh"

step "the image karst:test"
podman build --quiet --pull-never --format docker -t karst:test -f "$root/docker/Dockerfile" --build-arg BASE="$base" \
  --build-arg RUST_BASE="$base" --build-arg PREBUILT=target/release "$root" >/dev/null
podman image prune --force >/dev/null

step "a picture without any server"
"$root/target/release/karst" render "$root/scenes/cornell.json" -o "$work/cornell.exr" 2>/dev/null >&2
"$root/docker/test.sh" --image karst:test --expect "$(sha256sum "$work/cornell.exr" | cut -d ' ' -f 1)"

tools="$root/target/tools/k8s/venv/bin/python3"
"$root/k8s/play.sh" --python "$([ -x "$tools" ] && echo "$tools" || echo python3)" karst:test
