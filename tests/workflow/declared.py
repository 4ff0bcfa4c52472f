"""The rules of the workflow as Snakemake has read them, with their captions."""

import json
from types import SimpleNamespace
from typing import NamedTuple

import jinja2

#: Beside the Snakefile of a project: writes down the rules of a configuration, runs nothing.
SNAKEFILE = """
include: "Snakefile"

import json
from pathlib import Path

def values(params):
    return {name: value for name, value in params.items() if not callable(value)}

def captions(one):
    shown = [path.flags["report"] for path in one.output if "report" in path.flags]
    return [figure.caption.get_path_or_uri(secret_free=True) for figure in shown]

Path("declared.json").write_text(json.dumps({
    "config": config,
    "rules": {
        one.name: {
            "params": values(one.params),
            "arguments": [*one.params.keys()],
            "inputs": [*one.input.keys()],
            "outputs": [*map(str, one.output)],
            "wildcards": [*one.wildcard_names],
            "log": [*map(str, one.log)],
            "benchmark": str(one.benchmark or ""),
            "captions": captions(one),
        }
        for one in workflow.rules
        if not one.name.startswith("_")
    },
}))
"""


class Declared(NamedTuple):
    """The rules of one configuration, and the plain values that captions get."""

    config: dict
    rules: dict

    def caption(self, name):
        """Return the caption of a figure, or of a table as "name_table", in one line."""
        rule, path = next(
            (rule, path)
            for rule in self.rules.values()
            for path in rule["captions"]
            if path.endswith(f"/{name}.rst")
        )
        return self.rendered(rule, path)

    def rendered(self, rule, path):
        """Return the text of a caption of a rule as the report has it, in one line."""
        with open(path, encoding="utf-8") as file:
            template = jinja2.Environment(undefined=jinja2.StrictUndefined).from_string(file.read())
        snakemake = SimpleNamespace(
            config=self.config, params=rule["params"], wildcards={"scene": "{scene}"}
        )
        return " ".join(template.render(snakemake=snakemake).split())


def declared(project, *arguments):
    """Return the `Declared` of a project under the arguments of a dry run."""
    (project / "Declared.smk").write_text(SNAKEFILE, encoding="utf-8")
    project.snakemake("-n", "-q", "-s", "Declared.smk", *arguments)
    return Declared(**json.loads((project / "declared.json").read_text(encoding="utf-8")))
