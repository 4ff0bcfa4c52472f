"""The rules of the workflow as Snakemake reads them, with their captions."""

import json
from types import SimpleNamespace
from typing import NamedTuple

import jinja2

#: Beside the Snakefile of a project: writes the rules of a configuration to a file.
_SNAKEFILE = """
include: "Snakefile"

import json
from pathlib import Path

def captions(job):
    reported = [path.flags["report"] for path in job.output if "report" in path.flags]
    return [figure.caption.get_path_or_uri(secret_free=True) for figure in reported]

jobs = {
    job.name: {
        "params": {name: value for name, value in job.params.items() if not callable(value)},
        "outputs": [*map(str, job.output)],
        "captions": captions(job),
        "parts": [path.flags["report"].category for path in job.output if "report" in path.flags],
    }
    for job in workflow.rules
    if not job.name.startswith("_")
}
Path("declared.json").write_text(json.dumps({"config": config, "rules": jobs}))
"""


class Declared(NamedTuple):
    """A configuration, and params, outputs and caption paths of each rule by name."""

    config: dict
    rules: dict

    def caption(self, name):
        """Return the caption of a figure, or of a table as "name_table", in one line."""
        return next(
            self.rendered(rule, path)
            for rule in self.rules.values()
            for path in rule["captions"]
            if path.endswith(f"/{name}.rst")
        )

    def rendered(self, rule, path):
        """Return the text of a rule's caption, rendered as in the report, in one line."""
        with open(path, encoding="utf-8") as file:
            template = jinja2.Environment(undefined=jinja2.StrictUndefined).from_string(file.read())
        snakemake = SimpleNamespace(
            config=self.config, params=rule["params"], wildcards={"scene": "{scene}"}
        )
        return " ".join(template.render(snakemake=snakemake).split())


def declared(project, *arguments):
    """Return the configuration and rules of a project, by a dry run with the given arguments."""
    (project / "Declared.smk").write_text(_SNAKEFILE, encoding="utf-8")
    project.snakemake("-n", "-q", "-s", "Declared.smk", *arguments)
    return Declared(**json.loads((project / "declared.json").read_text(encoding="utf-8")))
