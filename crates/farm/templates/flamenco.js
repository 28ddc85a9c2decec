// @ABOUT@
// A job type for Flamenco 3: put this file into the manager's `scripts` folder, refresh the job types, and submit a job of this type.
const JOB_TYPE = {
    label: "Etalon: @NAME@",
    settings: [
        { key: "program", type: "string", default: @JSON_PROGRAM@, description: "The program, as workers find it" },
        { key: "folder", type: "string", default: @JSON_HERE@, description: "The folder in which it runs" },
        { key: "shards", type: "int32", default: @COUNT@, propargs: { min: 1 }, description: "Tasks" },
    ],
};

function compileJob(job) {
    const s = job.settings;
    const shell = (command) => author.Command("exec", { exe: "bash", args: ["-c", "cd " + JSON.stringify(s.folder) + " && " + command] });
    const parts = [];
    for (let i = 1; i <= s.shards; i++) {
        const task = author.Task("render " + i, "misc");
        task.addCommand(shell("mkdir -p @JS_FOLDER@ && " + s.program + " render " + @JSON_ARGUMENTS@ + " --shard " + i + "/" + s.shards@JS_OUTPUT@));
        job.addTask(task);
        parts.push(task);
    }
@MERGE_FLAMENCO@
}
