#!/bin/bash
# The missing cases of a study as a job array, then its data set:  bash array.sh study.toml
# [slurm] of the study file has the options of sbatch and the number of cases of a task. Call it again after time
# limits: cases that were interrupted resume after their last finished step.
set -euo pipefail

study=$1
name=$(basename "$study" .toml)

script=$(hexcontact study "$study" --slurm)
if [[ $script != *"#SBATCH --array="* ]]; then # no case is missing
  exec hexcontact study "$study" --collect
fi
array=$(sbatch --parsable <<< "$script")
sbatch --dependency="afterany:$array" --job-name="$name-collect" --output="$name-collect.log" --time=10 \
  --wrap="exec hexcontact study $(printf %q "$study") --collect"
