#!/bin/bash
# Scores with several GPUs of one host, a shard on each. In: the number of GPUs, the file of scores to write, and the
# arguments of `gs4d score` except --adapter, --shard and --out. Out: the scores, and beside them the parts, from which the
# same call resumes.
#
#   bash docs/farm/gpus.sh 4 energy.f32 chkpnt30000.pth --data data/toybox --variant energy --engine gpu
#
# `--adapter` takes the number of a GPU, since Vulkan ignores CUDA_VISIBLE_DEVICES. GS4D_ADAPTERS lists the numbers, for
# hosts whose first adapters are not these GPUs: GS4D_ADAPTERS='1 2 3 4'.
set -euo pipefail
count=$1 out=$2
shift 2
read -ra adapters <<<"${GS4D_ADAPTERS:-$(seq -s ' ' 0 $((count - 1)))}"
parts=() runs=()
for ((shard = 0; shard < count; shard++)); do
  parts+=("$out.$shard.gs4p")
  gs4d score "$@" --adapter "${adapters[shard]}" --shard "$shard/$count" --out "${parts[shard]}" &
  runs+=("$!")
done
code=0
for run in "${runs[@]}"; do wait "$run" || code=$?; done
[ "$code" -eq 0 ] || exit "$code"
gs4d score "$@" --out "$out" --merge "${parts[@]}"
