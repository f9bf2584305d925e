#!/bin/bash
# One run on one node:  sbatch run.sh fretting.toml
# A minute before the time limit the run ends after its last finished step; the job requeues itself and resumes it,
# as after preemption or a failure of the node. The result is fretting.nc where sbatch was called.
#SBATCH --nodes=1 --ntasks=1 --cpus-per-task=8 --mem=16G
#SBATCH --time=24:00:00 --signal=USR1@60
#SBATCH --requeue --open-mode=append --output=%x-%j.log
set -euo pipefail

export OMP_NUM_THREADS=$SLURM_CPUS_PER_TASK
export SRUN_CPUS_PER_TASK=$SLURM_CPUS_PER_TASK # srun does not take it from the job

code=0
srun hexcontact run "$1" --resume --log-level info || code=$?
if [ "$code" -eq 138 ]; then # the signal
  scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
