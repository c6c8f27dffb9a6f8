#!/usr/bin/env bash
# A capture of a minute from end to end: films a take of the island in segments, trains and bakes each by the jobs of a plan, joins them, cuts the
# capture into chunk files, and evaluates cameras that were held out: of the first and of the last segment alone, and of the first in the whole take.
# In: a folder for everything, and options of the example `film`, such as --size 400. Out: FOLDER/chunks, FOLDER/packed.gs4d,
# FOLDER/segment-NN.gs4d with their reports, and tables. The same call goes on after an interruption.
#
#   examples/film/take.sh [FOLDER] [OPTIONS OF THE EXAMPLE...]
#
# LENGTH, SEGMENTS  whole seconds of the take, a multiple of four, and into how many segments of whole seconds it is divided; default: 60 and 12
# ADAPTERS          the GPUs that train, by their numbers, each a share of the segments; default: 0
# FILM, GS4D        the example and the command, if they are built already; else cargo builds both
# BAKE, CUT         options of `gs4d bake` of each segment, and of `gs4d compress` of the take
set -euo pipefail
here=$(cd "$(dirname "$0")/../.." && pwd)
folder=${1:-take}
[ $# -eq 0 ] || shift
length=${LENGTH:-60} segments=${SEGMENTS:-12}
if ((length % segments)); then
  printf 'error: %d s are no whole seconds for each of %d segments\n' "$length" "$segments" >&2
  exit 2
fi
seconds=$((length / segments))
if [ -z "${FILM:-}" ] || [ -z "${GS4D:-}" ]; then
  (cd "$here" && cargo build --release --features viewer,cli --example film --bin gs4d)
  built=$(cd "$here" && realpath -m "${CARGO_TARGET_DIR:-target}")/release
fi
FILM=${FILM:-$built/examples/film}
# The jobs of a plan call the command by its name.
GS4D=$(realpath "${GS4D:-$built/gs4d}")
read -ra adapters <<<"${ADAPTERS:-0}"
read -ra bake <<<"${BAKE:---gaussians 60000 --train-steps 8000 --quality lossless}"
read -ra cut <<<"${CUT:---chunk 1 --layers 5,20,25,50 --codebooks 512,512 --verify 0}"
film=(--take "$length" --cameras 24 --times "$((10 * seconds))" --size 400 "$@")

mkdir -p "$folder/bin" "$folder/plans"
folder=$(cd "$folder" && pwd)
# Segments of another take would be used as they are.
settings="$segments segments, film ${film[*]}, bake ${bake[*]}"
if [ -e "$folder/settings" ] && [ "$(cat "$folder/settings")" != "$settings" ]; then
  printf 'error: %s has a take of other settings (%s): name another folder\n' "$folder" "$(cat "$folder/settings")" >&2
  exit 2
fi
printf '%s' "$settings" >"$folder/settings"
rm -f "$folder"/plans/*.json
ln -sf "$GS4D" "$folder/bin/gs4d"
export PATH="$folder/bin:$PATH"

name() { printf 'segment-%02d' "$1"; }

# Films every N-th segment from segment I on, unless it has been filmed. Ends with its film when it is terminated.
film_share() {
  local segment part child=
  trap 'kill "$child" 2>/dev/null; exit 143' TERM
  for ((segment = $1; segment < segments; segment += $2)); do
    part=$folder/$(name "$segment")
    [ ! -e "$part" ] || continue
    rm -rf "${part:?}.new"
    "$FILM" "$part.new" --from "$((seconds * segment))" --until "$((seconds * (segment + 1)))" "${film[@]}" &
    child=$!
    wait "$child"
    mv "$part.new" "$part"
  done
}

# Waits for jobs, and ends with the first exit code of them that is not 0.
jobs=()
trap 'kill "${jobs[@]}" 2>/dev/null; exit 130' INT TERM
all() {
  local code=0 job
  for job in "${jobs[@]}"; do wait "$job" || code=$?; done
  jobs=()
  [ "$code" -eq 0 ] || exit "$code"
}

count=${#adapters[@]}
for ((share = 0; share < count; share++)); do
  film_share "$share" "$count" >"$folder/film-$share.log" &
  jobs+=("$!")
done
all
baked=()
for ((segment = 0; segment < segments; segment++)); do
  part=$folder/$(name "$segment")
  gs4d bake "$part" --engine gpu --adapter "${adapters[segment % count]}" -o "$part.gs4d" "${bake[@]}" --plan "$folder/plans/$(name "$segment").json"
  baked+=("$part.gs4d")
done
# Each plan alone, on any machine that sees the folder, gives its segment: docs/farm has the engines. Here each GPU has a share of the plans.
for ((share = 0; share < count; share++)); do
  python3 "$here/docs/farm/run.py" "$folder/plans" "$share/$count" >"$folder/bake-$share.log" &
  jobs+=("$!")
done
all
rm -rf "$folder/take.gs4d" "$folder/packed.gs4d" "$folder/chunks"
gs4d join "${baked[@]}" -o "$folder/take.gs4d"
gs4d compress "$folder/take.gs4d" "$folder/packed.gs4d" "${cut[@]}"
gs4d split "$folder/packed.gs4d" -o "$folder/chunks" --data "$folder/$(name 0)"
gs4d info "$folder/chunks/index.gs4d"
printf '\nCameras that were held out, of the first and of the last segment:\n'
for segment in 0 $((segments - 1)); do gs4d eval "$folder/$(name "$segment").gs4d" --data "$folder/$(name "$segment")" --split test; done
printf '\nThose of the first, in the whole take:\n'
gs4d eval "$folder/packed.gs4d" --data "$folder/$(name 0)" --split test
