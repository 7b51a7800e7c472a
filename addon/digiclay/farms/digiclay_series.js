// SPDX-License-Identifier: GPL-3.0-or-later
//
// Job type of Flamenco 3 for a job series of digiclay. Put this file into the folder "scripts" beside
// flamenco-manager, and restart the Manager. A job comes from 'digiclay batch JOBS --submit flamenco'.

var JOB_TYPE = {
    label: "Digiclay Series",
    description: "Runs, frames, films and the page of a digiclay job series",
    settings: [
        { key: "program", type: "string", required: true,
          description: "digiclay, or Blender with its extension; a variable of the Manager serves too" },
        { key: "program_args", type: "string", required: true,
          description: "Arguments before those of digiclay, as JSON" },
        { key: "series", type: "string", subtype: "dir_path", required: true,
          description: "Folder of the series, on a drive that all Workers share" },
        { key: "tasks", type: "string", required: true,
          description: "Tasks of the series in their order, as JSON" }
    ]
};

function compileJob(job) {
    var settings = job.settings;
    var leading = JSON.parse(settings.program_args);
    var plan = JSON.parse(settings.tasks);
    var made = [];
    for (var number = 0; number < plan.length; number++) {
        var one = plan[number];
        var place = one.folder ? settings.series + "/" + one.folder : settings.series;
        var task = author.Task(one.name, one.type);
        task.addCommand(author.Command("exec", {
            exe: settings.program,
            args: leading.concat([one.command, place], one.options)
        }));
        for (var need = 0; need < one.needs.length; need++) {
            task.addDependency(made[one.needs[need]]);
        }
        made.push(task);
        job.addTask(task);
    }
}
