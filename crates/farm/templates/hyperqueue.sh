#!/bin/sh
# @ABOUT@
# An array of @COUNT@ tasks on a HyperQueue server that runs (`hq server start`, `hq worker start`)@THEN_COMMENT@. A task whose worker is
# lost is given to another one, and goes on from what its file holds.
set -eu
mkdir -p @FOLDER@
cat > @FOLDER@/task.sh <<'TASK'
exec @PROGRAM@ render @ARGUMENTS@ --shard "$HQ_TASK_ID/@COUNT@"@OUTPUT_HYPERQUEUE@
TASK
hq submit --wait --name @NAME@ --array 1-@COUNT@ --crash-limit 5 \
    --stdout '@FOLDER@/%{TASK_ID}.log' --stderr '@FOLDER@/%{TASK_ID}.log' bash @FOLDER@/task.sh
@MERGE@
