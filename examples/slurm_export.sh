#!/bin/bash
# An array of jobs that make one dataset together, in 16 parts; submit it again to go on where it was, all of it or the
# parts that failed:
#   sbatch --array=0-15 examples/slurm_export.sh 16 data/ cut_in.yaml --seeds 0:1900
#   sbatch --array=3,7 examples/slurm_export.sh 16 data/ cut_in.yaml --seeds 0:1900
# The number of parts stands in the command and not in the array, so that part 3 is the same in both. The folder, and the
# plan beside it that the jobs share, lie on a file system that all nodes mount.
#SBATCH --job-name=scarl-export
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=8
#SBATCH --mem=8G
#SBATCH --time=08:00:00
#SBATCH --output=scarl_export_%a.out
#SBATCH --open-mode=append
#SBATCH --requeue
set -euo pipefail

parts=$1
out=$2
shift 2
if ! [[ "$parts" =~ ^[1-9][0-9]*$ ]] || [ "$SLURM_ARRAY_TASK_ID" -ge "$parts" ]; then
    echo "part $SLURM_ARRAY_TASK_ID of '$parts': give the number of parts first, and --array within 0 to it less one" >&2
    exit 2
fi

exec srun scarl-sionna export "$@" --out "$out" --plan "${out%/}.plan.json" \
    --shard "$SLURM_ARRAY_TASK_ID/$parts" --on-error record
