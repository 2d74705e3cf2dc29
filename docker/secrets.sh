#!/usr/bin/env bash
# Makes what a server and its workers need to trust each other: a TLS pair, a token for each role, the tokens file.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: docker/secrets.sh [--engine podman|docker] [--image NAME] --name HOST [--name HOST…] FOLDER

Writes into FOLDER, which only its owner can enter:
  tls/cert.pem tls/key.pem   a self-signed pair for these host names and localhost
  tokens                     the server's file: one line per token, with its hash
  work.token submit.token view.token admin.token
What is there already stays. Without --image the program karst-server is taken from PATH.
TEXT
}

fail() {
  printf 'error: %s\n' "$1" >&2
  exit 1
}

engine=podman image="" folder="" names=()
while [ $# -gt 0 ]; do
  case "$1" in
    --engine) engine="${2:?--engine podman|docker}" && shift 2 ;;
    --image) image="${2:?--image NAME}" && shift 2 ;;
    --name) names+=(--name "${2:?--name HOST}") && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    -*) usage >&2 && fail "$1: no such option" ;;
    *) [ -z "$folder" ] || fail "found a second folder, $1"
      folder="$1" && shift ;;
  esac
done
[ -n "$folder" ] || { usage >&2 && fail "FOLDER is missing"; }
[ ${#names[@]} -gt 0 ] || { usage >&2 && fail "--name HOST is missing: clients check it against the address they call"; }

mkdir -p "$folder"
chmod 0700 "$folder"
folder="$(cd -- "$folder" && pwd)"

# karst_server ARGUMENT…: the program, which sees the folder under the same path in a container.
karst_server() {
  if [ -z "$image" ]; then
    karst-server "$@"
  else
    "$engine" run --rm --no-healthcheck --network none --read-only --cap-drop ALL --security-opt no-new-privileges \
      --user "$(id -u):$(id -g)" --volume "$folder:$folder" "$image" "$@"
  fi
}

if [ ! -s "$folder/tls/key.pem" ]; then
  karst_server token init --tls "${names[@]}" --name localhost --data "$folder" >/dev/null
  for file in cert key; do
    [ -s "$folder/tls/$file.pem" ] || fail "karst-server wrote no $folder/tls/$file.pem"
  done
fi

touch "$folder/tokens"
for role in work submit view admin; do
  [ ! -s "$folder/$role.token" ] || continue
  said="$(karst_server token new --role "$role" --name "$role")"
  line="$(grep -oE "\b$role $role [0-9a-f]{64}\b" <<<"$said" | head -n 1)" || fail "karst-server printed no line for a tokens file"
  # The token is the word whose hash is in the line: so a token that would not be taken is noticed here.
  token=""
  for word in $said; do
    [ "$(printf %s "$word" | sha256sum | cut -d ' ' -f 1)" != "${line##* }" ] || token="$word"
  done
  [ -n "$token" ] || fail "karst-server printed no token with the hash ${line##* }"
  printf %s "$token" >"$folder/$role.token"
  printf '%s\n' "$line" >>"$folder/tokens"
done

# Containers read these as user 10001. On this machine nobody gets past the folder, which is its owner's alone.
chmod 0755 "$folder/tls"
chmod 0644 "$folder"/tls/*.pem "$folder/tokens" "$folder"/*.token
printf '%s\n' "$folder"
