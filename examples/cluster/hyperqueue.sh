#!/usr/bin/env bash
# Computes a map with HyperQueue: a task array with one task per shard, then the merge.
#
#   hyperqueue.sh SHARDS FOLDER OPTION...
#
# Written from the documentation of HyperQueue; NOT RUN by this project. A server must run
# (`hq server start`), and workers: `hq worker start` on each machine, or on a Slurm cluster
# `hq alloc add slurm --time-limit 1h`. FOLDER is on a file system that all machines share. A task is
# started again by HyperQueue where its worker is lost, and continues from its tiles. A task that
# fails for another reason is not: the same command again continues with the tiles that are missing.
set -euo pipefail
if [ $# -lt 2 ]; then
    echo "usage: $0 SHARDS FOLDER OPTION..." >&2
    exit 2
fi
shards=$1
folder=$2
shift 2
program=$(command -v sim-host) || { echo "sim-host is not on PATH" >&2; exit 2; }
program=$(realpath "$program")
mkdir -p "$folder"
cd "$folder"
# The task expands HQ_TASK_ID; the other values are arguments of its shell.
hq submit --wait --name=map --array="1-$shards" --cpus=1 --env RAYON_NUM_THREADS=1 -- \
    /bin/bash -c '
        program=$0 shards=$1
        shift
        exec "$program" map "$@" --shard "$HQ_TASK_ID/$shards" --work "shard-$HQ_TASK_ID"
    ' "$program" "$shards" "$@"
# Refuses an incomplete map, and names its missing tiles.
"$program" map merge shard-*/ --out map.csv --parquet map.parquet --force
