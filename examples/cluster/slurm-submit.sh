#!/usr/bin/env bash
# Computes a map on a Slurm cluster: an array job with one task per shard, and the merge after it.
#
#   slurm-submit.sh SHARDS FOLDER OPTION...
#   slurm-submit.sh 100 /shared/map --speeds 2000 --amplitudes 2000
#
# FOLDER is on a file system that all nodes share. OPTION... are those of `sim-host map` that define
# the map. The same command again continues with the tiles that are missing.
set -euo pipefail
if [ $# -lt 2 ]; then
    echo "usage: $0 SHARDS FOLDER OPTION..." >&2
    exit 2
fi
shards=$1
folder=$2
shift 2
scripts=$(dirname "$(realpath "$0")")
command -v sim-host >/dev/null || { echo "sim-host is not on PATH" >&2; exit 2; }
mkdir -p "$folder"
map=$(sbatch --parsable --chdir="$folder" --array="1-$shards" \
    "$scripts/slurm-shard.sh" "$shards" "$@")
merge=$(sbatch --parsable --chdir="$folder" --dependency="afterok:${map%%;*}" \
    --kill-on-invalid-dep=yes "$scripts/slurm-merge.sh")
echo "array job ${map%%;*}, then job ${merge%%;*}, which writes $folder/map.csv"
