sbatch --dependency=afterok:"${job%%;*}" <<'TASK'
#!/bin/bash
#SBATCH --job-name=@NAME@-merge
#SBATCH --output=@FOLDER@/%j-merge.log
@MERGE@
TASK
