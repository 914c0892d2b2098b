#!/usr/bin/env bash
# One shard of a map: a task of the array job of slurm-submit.sh.
#
# A shard that was killed, or whose time limit is near, is requeued and continues from its tiles.
# A shard that fails, for instance with an invalid option, is not.
#SBATCH --job-name=map-shard
#SBATCH --output=shard-%a.log
#SBATCH --open-mode=append
#SBATCH --cpus-per-task=1
#SBATCH --time=01:00:00
# SIGTERM to this script 60 s before the time limit.
#SBATCH --signal=B:TERM@60
#SBATCH --requeue
set -uo pipefail
most_restarts=10
# Not SLURM_ARRAY_TASK_COUNT: it is 1 where a single shard is submitted again.
shards=$1
shift
shard=$SLURM_ARRAY_TASK_ID
restarts=${SLURM_RESTART_COUNT:-0}
echo "shard $shard of $shards on $SLURMD_NODENAME, restart $restarts"

stopped=no
RAYON_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1} \
    sim-host map "$@" --shard "$shard/$shards" --work "shard-$shard" &
process=$!
# On SIGTERM the program finishes the tiles in progress. The trap ends `wait`, so wait again.
trap 'stopped=yes; kill -TERM "$process" 2>/dev/null' TERM
wait "$process"
status=$?
while kill -0 "$process" 2>/dev/null; do
    wait "$process"
    status=$?
done
[ "$status" -eq 0 ] && exit 0

# From 128 on: ended by a signal.
if [ "$stopped" = yes ] || [ "$status" -gt 128 ]; then
    if [ "$restarts" -lt "$most_restarts" ]; then
        echo "shard $shard ended with status $status; it is requeued"
        # Not SLURM_JOB_ID: that of the last task is the array's, and would requeue all tasks.
        # Slurm ends this script when it has requeued the job. Returning earlier would end the job.
        scontrol requeue "${SLURM_ARRAY_JOB_ID}_$shard" && sleep 600
    else
        echo "shard $shard ended with status $status after $restarts restarts; it is given up"
    fi
fi
exit "$status"
