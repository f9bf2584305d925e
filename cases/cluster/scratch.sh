#!/bin/bash
# One run on the disk of its node, copied back when it ends or is interrupted:  sbatch scratch.sh fretting.toml
# A failure of the node loses the steps since the last copy. Run one job at a time for a deck: none sees the locks of
# another. Signals and requeue: run.sh.
#SBATCH --nodes=1 --ntasks=1 --cpus-per-task=8 --mem=16G
#SBATCH --time=24:00:00 --signal=USR1@300
#SBATCH --requeue --open-mode=append --output=%x-%j.log
set -euo pipefail

export OMP_NUM_THREADS=$SLURM_CPUS_PER_TASK
export SRUN_CPUS_PER_TASK=$SLURM_CPUS_PER_TASK # srun does not take it from the job

result=$(basename "$1" .toml).nc
scratch=$(mktemp -d "${SLURM_TMPDIR:-${TMPDIR:-/tmp}}/hexcontact.XXXXXX")
trap 'rm -rf "$scratch"' EXIT

for made in "$result" "$result.d"; do # of an earlier attempt
  if [ -e "$made" ]; then cp -a "$made" "$scratch"; fi
done

code=0
srun hexcontact run "$1" --output "$scratch/$result" --resume --log-level info || code=$?

rm -rf "$result.new"
cp -a "$scratch" "$result.new" # complete before it replaces the last copy
rm -rf "$result.d"
find "$result.new" -mindepth 1 -maxdepth 1 -exec mv -t . {} +
rmdir "$result.new"

rm -rf "$scratch"
if [ "$code" -eq 138 ]; then # the signal
  scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
