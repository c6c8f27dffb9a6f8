# What `.ci/run` and `.ci/full` share. In: to be sourced by one of them. Out: the root of the clone as working directory, what the machine
# lacks installed, functions for steps, lints and tests, and at the end a summary and the exit code.
#
# CARGO_TARGET_DIR  where to build; default: a folder of the user's cache, outside the clone, used again by the next run
# GS4D_DATA         folder of the trained captures; default: ../shared/data where that exists, else their tests skip themselves
#
# Tests add what they skip to the file that GS4D_SKIPPED names, which is set here; the summary counts it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec </dev/null

# The features that can be built by themselves, those with Bevy apart. `default` is `bevy`; `openxr` is not tested.
without_bevy=(renderer offline cli)
with_bevy=(bevy pbr picking testing inspector viewer)
# Every test, example and document needs no more than these.
everything=viewer,cli

scratch=$(mktemp -d)
current=preparation
began=0
summary=()
export GS4D_SKIPPED="$scratch/skipped"

# Lists why tests were skipped, or parts of them, and how many each time; a test that ran twice counts once. In: `skipped: NAME: reason`.
skips() {
  printf '    tests skipped, or parts of them:\n'
  if [ -s "$GS4D_SKIPPED" ]; then
    sort -u "$GS4D_SKIPPED" | sed 's/^skipped: [^ ]*: //' | sort | uniq -c | sort -rn
  else
    printf '          0\n'
  fi
}

finish() {
  local status=$? line
  printf '\n==> Summary\n'
  for line in ${summary[@]+"${summary[@]}"}; do printf '    %s\n' "$line"; done
  if [ -s "$scratch/results" ]; then
    printf '    the last line of each test binary:\n'
    cat "$scratch/results"
    skips
  fi
  rm -rf "$scratch"
  if [ "$status" -eq 0 ]; then
    printf '    all of it holds, after %d s\n' "$SECONDS"
  else
    printf '    FAILED: %s, after %d s\n' "$current" "$SECONDS"
  fi
}
trap finish EXIT
# Without these, a run that is stopped would end as if it had passed.
trap 'exit 130' INT
trap 'exit 143' TERM

# Heads a step; `done_with` closes it.
step() {
  current=$1
  began=$SECONDS
  printf '\n==> %s (at %d s)\n' "$current" "$SECONDS"
}

# Notes the time that the step took, and a remark if one is given.
done_with() {
  summary+=("$(printf '%5d s  %s%s' "$((SECONDS - began))" "$current" "${1:+: $1}")")
}

# Shows a command and runs it.
show() {
  printf '    $ %s\n' "$*"
  "$@"
}

# Lints the crate with one set of features and no other; `''` is none. More arguments go to cargo.
lint() {
  show cargo clippy --locked --no-default-features --features "$1" "${@:2}" -- -D warnings
}

# Runs tests, and keeps the line with which each binary ends.
tests() {
  local status=0
  show cargo test --locked "$@" | tee "$scratch/tests" || status=$?
  grep '^test result:' "$scratch/tests" >>"$scratch/results" || true
  return "$status"
}

# How many of the tests just run have passed.
passed() {
  awk '/^test result: ok/ { sum += $4 } END { print sum + 0, "passed" }' "$scratch/tests"
}

# Lists the crates that a build with these features consists of, on this machine, each with its version.
crates() {
  cargo tree --locked --no-default-features --features "$1" --edges normal,build --prefix none --format '{p}' |
    cut -d ' ' -f 1,2 | sort -u
}

# Makes a subcommand of cargo available in this version: the installed one whichever it is, else one of our own.
tool() {
  local folder="$CARGO_TARGET_DIR/tools"
  command -v "$1" >/dev/null && return
  PATH="$PATH:$folder/bin"
  command -v "$1" >/dev/null || show cargo install --locked "$1" --version "$2" --root "$folder"
}

as_root() {
  if [ "$(id -u)" -ne 0 ] && command -v sudo >/dev/null; then sudo -n "$@"; else "$@"; fi
}

has_vulkan_driver() {
  [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] ||
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
}

# Installs what is missing and says what there is: the first step.
prepare() {
  local missing=()
  step 'What the machine has'
  command -v cc >/dev/null || missing+=(gcc libc6-dev)
  has_vulkan_driver || missing+=(mesa-vulkan-drivers libvulkan1)
  if [ ${#missing[@]} -gt 0 ] && command -v apt-get >/dev/null; then
    show as_root apt-get update
    show as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y "${missing[@]}"
  fi
  command -v cargo >/dev/null || PATH="$PATH:${CARGO_HOME:-$HOME/.cargo}/bin"
  if ! command -v cargo >/dev/null; then
    printf 'cargo is missing: install a Rust toolchain, as https://rustup.rs explains\n'
    exit 1
  fi
  if command -v rustup >/dev/null; then
    cargo fmt --version >/dev/null 2>&1 || show rustup component add rustfmt
    cargo clippy --version >/dev/null 2>&1 || show rustup component add clippy
  fi
  export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/bevy_gs4d/target}"
  # Incremental builds only pay where one tree is built over and over.
  export CARGO_INCREMENTAL=0
  # What another clone has built counts as built if its files are newer, but its tests look for their data in that clone.
  if [ -d "$CARGO_TARGET_DIR" ] && [ "$(cat "$CARGO_TARGET_DIR/clone" 2>/dev/null)" != "$PWD" ]; then
    show cargo clean --locked --package bevy_gs4d
    show cargo clean --locked --package bevy_gs4d --release
  fi
  mkdir -p "$CARGO_TARGET_DIR"
  printf '%s\n' "$PWD" >"$CARGO_TARGET_DIR/clone"
  if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    mkdir -m 700 "$scratch/runtime"
    export XDG_RUNTIME_DIR="$scratch/runtime"
  fi
  if [ -z "${GS4D_DATA:-}" ] && [ -d ../shared/data ]; then
    GS4D_DATA=$(cd ../shared/data && pwd)
    export GS4D_DATA
  fi
  cargo --version
  printf 'builds in %s\n' "$CARGO_TARGET_DIR"
  if [ -n "${GS4D_DATA:-}" ]; then
    captures="on the trained captures in $GS4D_DATA"
  else
    captures='without trained captures: their tests skip themselves (GS4D_DATA is not set)'
  fi
  printf 'tests run %s\n' "$captures"
  done_with
}
