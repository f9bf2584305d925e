#!/bin/bash
# One run in the memory of several nodes:  sbatch mpi.sh fretting.toml
# Needs a build with -Dmpi=enabled, and an MPI that Slurm's srun starts (srun --mpi=list): pmix for Open MPI, for MPICH
# SLURM_MPI_TYPE=pmi2 sbatch mpi.sh fretting.toml. Signals and requeue: run.sh; with MPICH the job ends with 137 instead.
#SBATCH --nodes=4 --ntasks-per-node=2 --cpus-per-task=4 --mem=32G
#SBATCH --time=24:00:00 --signal=USR1@60
#SBATCH --requeue --open-mode=append --output=%x-%j.log
set -euo pipefail

export OMP_NUM_THREADS=$SLURM_CPUS_PER_TASK
export SRUN_CPUS_PER_TASK=$SLURM_CPUS_PER_TASK # srun does not take it from the job

code=0
srun --mpi="${SLURM_MPI_TYPE:-pmix}" --kill-on-bad-exit=1 hexcontact run "$1" --resume --log-level info || code=$?
if [ "$code" -eq 138 ]; then # the signal
  scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
