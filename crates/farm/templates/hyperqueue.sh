#!/bin/sh
# @ABOUT@
# An array of @COUNT@ tasks on a HyperQueue server that runs (`hq server start`, `hq worker start`)@THEN_COMMENT@. A task whose worker is
# lost is given to another one, and goes on from what its file holds.
set -eu
mkdir -p @FOLDER@
cat > @FOLDER@/task.sh <<'TASK'
for try in 1 2 3 4 5; do
    @PROGRAM@ render @ARGUMENTS@ --shard "$HQ_TASK_ID/@COUNT@"@OUTPUT_HYPERQUEUE@ && exit 0
    status=$?
    # 75: worth trying again; 137: killed; 143: ended by SIGTERM.
    case $status in 75 | 137 | 143) ;; *) exit $status ;; esac
done
exit $status
TASK
hq submit --wait --name @NAME@ --array 1-@COUNT@ --crash-limit 5 \
    --stdout '@FOLDER@/%{TASK_ID}.log' --stderr '@FOLDER@/%{TASK_ID}.log' bash @FOLDER@/task.sh
@MERGE@
