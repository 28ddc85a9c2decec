# @ABOUT@
# An outline for OpenCue: `python3 FILE` submits it with pyoutline to the Cuebot of $CUEBOT_HOSTS; `python3 FILE --check` only prints what
# would be submitted.
import sys

import outline
import outline.cuerun
from outline.modules.shell import Shell

FOLDER = @JSON_HERE@
ARGUMENTS = @JSON_ARGUMENTS@

job = outline.Outline("@DNS_NAME@", shot="etalon", show="testing", user="etalon")
render = Shell(
    "render",
    command=[
        "bash",
        "-c",
        "cd '%s' && mkdir -p @JS_FOLDER@ && @PROGRAM@ render %s --shard #IFRAME#/@COUNT@@OUTPUT_OPENCUE@" % (FOLDER, ARGUMENTS),
    ],
    range="1-@COUNT@",
)
job.add_layer(render)
@MERGE_OPENCUE@
if __name__ == "__main__":
    if "--check" in sys.argv:
        launcher = outline.cuerun.OutlineLauncher(job, range="1-@COUNT@")
        print(launcher.serialize())
    else:
        outline.cuerun.launch(job, range="1-@COUNT@", use_pycuerun=False)
