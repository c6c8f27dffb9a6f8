#!/usr/bin/env bash
# The demo from end to end: films the island, trains and bakes it, and evaluates the cameras that were held out, at the moments of the
# training and halfway between them, and sockets on the points whose tracks are known. In: a folder for everything, and options of the example
# `film`, such as --size 400. Out: FOLDER/island.gs4d with its report, and three tables.
#
#   examples/film/island.sh [FOLDER] [OPTIONS OF THE EXAMPLE...]
#
# FILM, GS4D  the example and the command, if they are built already; else cargo builds and runs both
# BAKE        options of `gs4d bake`; default: a package of at most 2.5 MB
set -euo pipefail
folder=${1:-island}
[ $# -eq 0 ] || shift
film() { ${FILM:-cargo run --release --features viewer,cli --example film --} "$@"; }
gs4d() { ${GS4D:-cargo run --release --features viewer,cli --bin gs4d --} "$@"; }
read -ra bake <<<"${BAKE:---gaussians 90000 --train-steps 20000 --target-size 2.5}"

mkdir -p "$folder"
film "$folder/dataset" "$@"
film "$folder/between" --test-at 0.5 "$@"
gs4d bake "$folder/dataset" -o "$folder/island.gs4d" "${bake[@]}"
printf '\nCameras that were held out, at their own moments of the film:\n'
gs4d eval "$folder/island.gs4d" --data "$folder/dataset" --split test
printf '\nThe same cameras, halfway between the moments of the training:\n'
gs4d eval "$folder/island.gs4d" --data "$folder/between" --split train
printf '\nSockets on ten points, followed from the middle of the film, and their known tracks:\n'
gs4d socket "$folder/island.gs4d" --points "$folder/dataset/points.json"
