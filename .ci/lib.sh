# Common code of `.ci/run` and `.ci/full`. In: one of these scripts, which sources this file. Out: the root of the clone
# as working directory, missing programs installed, functions for steps, lints and tests, and at the end a summary and the
# exit code.
#
# CARGO_TARGET_DIR  build folder; default: a folder of the user's cache, outside the clone, which the next run uses again
# GS4D_DATA         folder of the trained captures; default: ../shared/data if it exists, else tests on captures are skipped
#
# Tests add a line for each skipped test to the file that GS4D_SKIPPED names, which is set here; the summary counts these lines.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec </dev/null

# The features that are built separately, without and with Bevy. Left out are `default`, which implies `bevy`, `openxr`,
# which is not tested, and `web`, with which `.ci/web` builds the pages for wasm32.
without_bevy=(sound renderer offline fourdgs cli)
with_bevy=(bevy pbr picking testing inspector bevy_audio http_ranges viewer)
# The features that all tests, examples and documents together need.
everything=viewer,cli

scratch=$(mktemp -d)
current=preparation
began=0
summary=()
export GS4D_SKIPPED="$scratch/skipped"

# Lists the reasons of skipped tests, and of skipped parts of tests, with their counts; a test that ran twice counts once.
# In: lines `skipped: NAME: reason`.
skips() {
  printf '    skipped tests and parts of tests, by reason:\n'
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
    printf '    the result of each test binary:\n'
    cat "$scratch/results"
    skips
  fi
  rm -rf "$scratch"
  if [ "$status" -eq 0 ]; then
    printf '    passed, after %d s\n' "$SECONDS"
  else
    printf '    FAILED: %s, after %d s\n' "$current" "$SECONDS"
  fi
}
trap finish EXIT
# Without these traps, an interrupted run would exit with success.
trap 'exit 130' INT
trap 'exit 143' TERM

# Begins a step and prints its heading; `done_with` ends the step.
step() {
  current=$1
  began=$SECONDS
  printf '\n==> %s (at %d s)\n' "$current" "$SECONDS"
}

# Adds the time of the step to the summary, with an optional remark.
done_with() {
  summary+=("$(printf '%5d s  %s%s' "$((SECONDS - began))" "$current" "${1:+: $1}")")
}

# Prints a command and runs it.
show() {
  printf '    $ %s\n' "$*"
  "$@"
}

# Lints the crate with the given features only; `''` is no feature. Further arguments are passed to cargo.
lint() {
  show cargo clippy --locked --no-default-features --features "$1" "${@:2}" -- -D warnings
}

# Runs tests, and records the result line of each test binary.
tests() {
  local status=0
  show cargo test --locked "$@" | tee "$scratch/tests" || status=$?
  grep '^test result:' "$scratch/tests" >>"$scratch/results" || true
  return "$status"
}

# Prints the number of passed tests of the last call of `tests`.
passed() {
  awk '/^test result: ok/ { sum += $4 } END { print sum + 0, "passed" }' "$scratch/tests"
}

# Lists the crates, with versions, of a build with the given features on this machine.
crates() {
  cargo tree --locked --no-default-features --features "$1" --edges normal,build --prefix none --format '{p}' |
    cut -d ' ' -f 1,2 | sort -u
}

# Makes a subcommand of cargo available: any installed version, else the given version, installed into the build folder.
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

has_browser() {
  local name
  for name in chromium chromium-browser google-chrome chrome; do command -v "$name" >/dev/null && return; done
  return 1
}

# The first step: installs missing programs, and prints the build folder and the captures in use.
prepare() {
  local missing=()
  step 'Preparation of the machine'
  command -v cc >/dev/null || missing+=(gcc libc6-dev)
  command -v c++ >/dev/null || missing+=(g++)
  has_vulkan_driver || missing+=(mesa-vulkan-drivers libvulkan1)
  has_browser || missing+=(chromium)
  if [ ${#missing[@]} -gt 0 ] && command -v apt-get >/dev/null; then
    show as_root apt-get update
    show as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}"
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
  # Nobody debugs these builds; panics name their lines without it.
  export CARGO_PROFILE_DEV_DEBUG=false
  # Incremental builds only save time if one tree is built repeatedly.
  export CARGO_INCREMENTAL=0
  # Cargo would reuse builds of another clone whose files are newer, but their tests read data from that clone.
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
    captures='without trained captures: tests that need them are skipped (GS4D_DATA is not set)'
  fi
  printf 'tests run %s\n' "$captures"
  done_with
}
