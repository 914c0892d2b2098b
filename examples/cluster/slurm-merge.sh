#!/usr/bin/env bash
# The merge of all shards, after the array job of slurm-submit.sh.
#SBATCH --job-name=map-merge
#SBATCH --output=merge.log
#SBATCH --open-mode=append
#SBATCH --cpus-per-task=1
#SBATCH --time=01:00:00
#SBATCH --requeue
set -euo pipefail
# --force: a merge that was interrupted may have written one of the files.
sim-host map merge shard-*/ --out map.csv --parquet map.parquet --force
