#!/usr/bin/env bash
# A capture of the island that keeps its petals: films it with all cameras at once, finds the points of every moment, trains from these with their
# velocities, bakes, and compares sockets with the points whose tracks are known. In: a folder for everything, and options of the example `film`,
# such as --size 400. Out: FOLDER/petals.gs4d with its report, and two tables.
#
#   examples/film/petals.sh [FOLDER] [OPTIONS OF THE EXAMPLE...]
#
# FILM, GS4D  the example and the command, if they are built already; else cargo builds and runs both
# TRAIN       options of `gs4d train`; default: 200,000 Gaussians that live for few moments, of which none fades without need
# BAKE        options of `gs4d bake`; default: 100,000 Gaussians, in layers
set -euo pipefail
folder=${1:-petals}
[ $# -eq 0 ] || shift
film() { ${FILM:-cargo run --release --features viewer,cli --example film --} "$@"; }
gs4d() { ${GS4D:-cargo run --release --features viewer,cli --bin gs4d --} "$@"; }
read -ra train <<<"${TRAIN:---gaussians 200000 --steps 10000 --time-scale 0.03 --opacity-weight 0 --scale-weight 0 --dropout 0 --noise 0}"
read -ra bake <<<"${BAKE:---keep 100000 --rounds 2 --steps 3000 --views 150 --progressive}"

mkdir -p "$folder"
film "$folder/dataset" --shutter together "$@"
gs4d footage "$folder/dataset" -o "$folder/points" --smallest 0.00002 --agreeing 0.75
gs4d train --data "$folder/dataset" --points "$folder/points/points3d.ply" --start points --start-velocity on "${train[@]}" \
  -o "$folder/petals.train.gs4d"
gs4d bake "$folder/petals.train.gs4d" --data "$folder/dataset" -o "$folder/petals.gs4d" "${bake[@]}"
printf '\nCameras that were held out:\n'
gs4d eval "$folder/petals.gs4d" --data "$folder/dataset" --split test
printf '\nSockets on ten points, followed from the middle of their times, and their known tracks:\n'
gs4d socket "$folder/petals.gs4d" --points "$folder/dataset/points.json"
