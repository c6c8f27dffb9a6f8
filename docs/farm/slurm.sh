#!/bin/bash
# A Slurm job array that divides captures among its tasks. In: a folder of plans; `gs4d` in the PATH. Out: the packages.
#
#   sbatch --array=0-199%8 docs/farm/slurm.sh plans
#
# With as many tasks as plans each task bakes one capture; with fewer, for captures that take seconds, several. The array
# must begin with 0. Add the needs of the captures, which `needs` in the plans has: --gres=gpu:1 --mem=16G --time=2:00:00. A
# task that a signal has ended returns to the queue at most five times and resumes; a task that gs4d refuses, with code 2,
# does not. GS4D_FARM is the folder of run.py, if the array is not submitted from the clone. Slurm starts a task again after
# the time `cred_expire` of its `AuthInfo`, by default 120 seconds.
#SBATCH --job-name=gs4d --requeue --open-mode=append
python3 "${GS4D_FARM:-docs/farm}/run.py" "$1" "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
code=$?
if [ "$code" -gt 128 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 5 ]; then
  scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit "$code"
