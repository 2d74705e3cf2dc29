#!/usr/bin/env bash
# Makes a small Debian from a package mirror as the base of the image, for places without a registry.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: docker/base.sh FOLDER

Gives podman a store of its own in FOLDER, puts localhost/karst-base:SUITE into it, made by debootstrap, and prints
that name. `source FOLDER/env.sh` makes podman use the store. SUITE is the release of this Debian, so that programs
which were built here run there. Takes root, debootstrap and podman with runc; what is there already stays.
MIRROR is a package mirror, such as https://deb.example/debian; unless given the first one that apt uses.
TEXT
}

fail() {
  printf 'error: %s\n' "$1" >&2
  exit 1
}

case "${1:-}" in
  -h | --help) usage && exit 0 ;;
  "") usage >&2 && fail "FOLDER is missing" ;;
esac
[ $# = 1 ] || { usage >&2 && fail "found $2 after FOLDER"; }
[ "$(id -u)" = 0 ] || fail "debootstrap needs root"
suite="$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)"
[ -n "$suite" ] && [ -e "/usr/share/debootstrap/scripts/$suite" ] || fail "debootstrap does not know this system's release, ${suite:-without a name}"
mkdir -p "$1"
folder="$(cd -- "$1" && pwd)"

# Both forms of apt's lists have the address of a mirror as a word; that of security updates has no whole release.
mirror_of_apt() {
  find /etc/apt -maxdepth 2 -type f \( -path '*/sources.list' -o -path '*/sources.list.d/*.list' -o -path '*/sources.list.d/*.sources' \) |
    sort | xargs -r sed -n '/^ *#/d; /security/d; s/.*\(https\{0,1\}:\/\/[^ ]*\).*/\1/p' | sed -n 1p
}

# A store of its own, and as little of the system as possible: no systemd, no journal, no more files than are allowed.
most="$(ulimit -Hn)"
[ "$most" != unlimited ] || most=1048576
cat >"$folder/storage.conf" <<CONF
[storage]
driver = "overlay"
graphroot = "$folder/store"
runroot = "$folder/run"
CONF
cat >"$folder/containers.conf" <<CONF
[containers]
default_ulimits = ["nofile=$most:$most", "nproc=$most:$most"]
netns = "host"
[network]
network_backend = "netavark"
[engine]
runtime = "runc"
cgroup_manager = "cgroupfs"
events_logger = "file"
CONF
cat >"$folder/env.sh" <<CONF
export CONTAINERS_STORAGE_CONF="$folder/storage.conf" CONTAINERS_CONF="$folder/containers.conf" BUILDAH_ISOLATION=chroot
CONF
# shellcheck disable=SC1091  # written above
source "$folder/env.sh"

image="localhost/karst-base:$suite"
if ! podman image exists "$image"; then
  mirror="${MIRROR:-$(mirror_of_apt)}"
  [ -n "$mirror" ] || fail "apt has no package mirror; name one in MIRROR"
  printf '== %s from %s\n' "$image" "$mirror" >&2
  tree="$folder/tree"
  rm -rf "$tree"
  debootstrap --variant=minbase --include=ca-certificates "$suite" "$tree" "$mirror" >"$folder/debootstrap.log" 2>&1 ||
    { tail -n 5 "$folder/debootstrap.log" >&2 && fail "debootstrap: $folder/debootstrap.log has all of it"; }
  # What nobody needs in a container, but for the licences.
  rm -rf "$tree"/usr/share/{man,info,locale}/* "$tree"/var/cache/apt/archives/*.deb "$tree"/var/cache/apt/*.bin \
    "$tree"/var/lib/apt/lists/* "$tree"/var/log/*.log "$tree"/var/log/apt/*
  find "$tree/usr/share/doc" -depth -type f ! -name copyright -delete
  tar -C "$tree" -c . | podman import --quiet --change 'CMD ["bash"]' - "$image" >/dev/null
  rm -rf "$tree"
fi
printf '%s\n' "$image"
