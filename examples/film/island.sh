#!/usr/bin/env bash
# The demo from end to end: films the island with all cameras at once, finds the points of every moment, trains from these with their velocities,
# so that petals stay, and bakes; evaluates the cameras that were held out, at the moments of the training and halfway between them, and sockets
# on the points whose tracks are known. In: a folder for everything, and options of the example `film`, such as --size 400. Out:
# FOLDER/island.gs4d with its report, and three tables.
#
#   examples/film/island.sh [FOLDER] [OPTIONS OF THE EXAMPLE...]
#
# FILM, GS4D  the example and the command, if they are built already; else cargo builds and runs both
# TRAIN       options of `gs4d train`; default: 200,000 Gaussians, of which those of what moves live for few moments, and none fades without need
# BAKE        options of `gs4d bake`; default: 100,000 Gaussians, in layers
set -euo pipefail
folder=${1:-island}
[ $# -eq 0 ] || shift
film() { ${FILM:-cargo run --release --features viewer,cli --example film --} "$@"; }
gs4d() { ${GS4D:-cargo run --release --features viewer,cli --bin gs4d --} "$@"; }
read -ra train <<<"${TRAIN:---gaussians 200000 --steps 5000 --time-scale 0.045 --untimed-scale 0.6 --timed-share 0.7 --opacity-weight 0 \
--scale-weight 0 --dropout 0 --noise 0}"
read -ra bake <<<"${BAKE:---keep 100000 --rounds 2 --steps 3000 --views 150 --progressive}"

mkdir -p "$folder"
film "$folder/dataset" --shutter together "$@"
film "$folder/between" --shutter together --test-at 0.5 "$@"
gs4d footage "$folder/dataset" -o "$folder/points" --smallest 0.00002 --agreeing 0.75
gs4d train --data "$folder/dataset" --points "$folder/points/points3d.ply" --start points --start-velocity on "${train[@]}" \
  -o "$folder/island.train.gs4d"
gs4d bake "$folder/island.train.gs4d" --data "$folder/dataset" -o "$folder/island.gs4d" "${bake[@]}"
printf '\nCameras that were held out, at their own moments of the film:\n'
gs4d eval "$folder/island.gs4d" --data "$folder/dataset" --split test
printf '\nThe same cameras, halfway between the moments of the training:\n'
gs4d eval "$folder/island.gs4d" --data "$folder/between" --split train
printf '\nSockets on ten points, followed from the middle of their times, and their known tracks:\n'
gs4d socket "$folder/island.gs4d" --points "$folder/dataset/points.json"
