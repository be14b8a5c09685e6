#!/bin/bash
# An array of jobs that make one dataset together; submit it again to go on where it was:
#   sbatch --array=0-15 examples/slurm_export.sh data/ drive.yaml city.yaml
# The folder lies on a file system that all nodes mount.
#SBATCH --job-name=scarl-export
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=8
#SBATCH --mem=8G
#SBATCH --time=08:00:00
#SBATCH --output=scarl_export_%a.out
#SBATCH --open-mode=append
#SBATCH --requeue
set -euo pipefail

out=$1
shift
count=$((SLURM_ARRAY_TASK_MAX - SLURM_ARRAY_TASK_MIN + 1))
index=$((SLURM_ARRAY_TASK_ID - SLURM_ARRAY_TASK_MIN))

exec srun scarl-sionna export "$@" --out "$out" --shard "$index/$count" --on-error record
