"""Read the rules of the workflow and render their captions as Snakemake does."""

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


class DeclaredRules(NamedTuple):
    """A configuration, and a dict of params, outputs, captions and report parts for each rule."""

    config: dict
    rules: dict

    def caption(self, name):
        """Return the caption of a figure, or of a table called "name_table", in one line."""
        return next(
            self.render_caption(rule, path)
            for rule in self.rules.values()
            for path in rule["captions"]
            if path.endswith(f"/{name}.rst")
        )

    def render_caption(self, rule, path):
        """Return the caption in a template file in one line, with the params of its rule."""
        with open(path, encoding="utf-8") as file:
            template = jinja2.Environment(undefined=jinja2.StrictUndefined).from_string(file.read())
        snakemake = SimpleNamespace(
            config=self.config, params=rule["params"], wildcards={"scene": "{scene}"}
        )
        return " ".join(template.render(snakemake=snakemake).split())


def read_declared_rules(project, *arguments):
    """Return the configuration and rules of a project by a dry run with Snakemake arguments."""
    (project / "Declared.smk").write_text(_SNAKEFILE, encoding="utf-8")
    project.snakemake("-n", "-q", "-s", "Declared.smk", *arguments)
    return DeclaredRules(**json.loads((project / "declared.json").read_text(encoding="utf-8")))
