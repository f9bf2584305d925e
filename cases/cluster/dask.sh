#!/bin/bash
# A study on workers that Dask requests from Slurm:  sbatch dask.sh study_dask.toml
# This job keeps the scheduler of Dask; [dask] of the study file describes the workers. Submitted again, it runs the missing cases.
#SBATCH --nodes=1 --ntasks=1 --cpus-per-task=1 --mem=2G
#SBATCH --time=24:00:00 --signal=B:USR1@60 --output=%x-%j.log
set -euo pipefail

exec hexcontact study "$1"
