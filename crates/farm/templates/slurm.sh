#!/bin/sh
# @ABOUT@
# Run this on a login node: it submits an array of @COUNT@ tasks@THEN_COMMENT@. Slurm's notice before it ends a task (KillWait, or
# --signal) makes a task keep what it has drawn; a task that is tried again goes on from there.
set -eu
mkdir -p @FOLDER@
job=$(sbatch --parsable <<'TASK'
#!/bin/bash
#SBATCH --job-name=@NAME@
#SBATCH --array=1-@COUNT@
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=@FOLDER@/%A_%a.log
#SBATCH --signal=B:TERM@60
@PROGRAM@ render @ARGUMENTS@ --shard "$SLURM_ARRAY_TASK_ID/@COUNT@"@OUTPUT_SLURM@ &
trap 'kill -TERM $!' TERM
wait $!; status=$?
# The trap has ended the first wait; the second one has the program's own answer.
wait $!; status=$?
# 75: worth trying again; 137: killed; 143: ended by SIGTERM.
case $status in 75 | 137 | 143) [ "${SLURM_RESTART_COUNT:-0}" -lt 5 ] && scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID" ;; esac
exit $status
TASK
)
echo "array job $job"
@MERGE_SLURM@
