"""A new study, added to a copy of the project as CONTRIBUTING describes it."""

import re

import pytest

from tests.workflow.project import ROOT, small_project

pytestmark = pytest.mark.slow


def test_a_new_study_takes_the_steps_of_contributing(tmp_path):
    project = small_project(tmp_path / "project")
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(?:py|python|rst)\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    section, study, drawing, rules, caption = blocks

    def append(path, text):
        with (project / path).open("a", encoding="utf-8") as file:
            file.write(text)

    def insert(path, before, text):
        old = (project / path).read_text(encoding="utf-8")
        assert old.count(before) == 1
        (project / path).write_text(old.replace(before, text + before), encoding="utf-8")

    append("gearlib/config/experiments.py", f"\n\n{section}")
    configuration = "gearlib/config/configuration.py"
    insert(configuration, '    *("measured", "tolerances"),\n]', '    "load_study",\n')
    section = "    load_study: e.LoadStudy = SECTION\n"
    insert(configuration, "    tolerances: Tolerances = SECTION\n", section)
    append("gearlib/studies/load_study.py", study)
    append("gearlib/figures/load_study_figure.py", drawing)
    append("workflow/rules/motions.smk", f"\n\n{rules}")
    (files,) = re.findall(r"^ *`(\"load_study\": .*)`$", page, re.MULTILINE)
    insert("workflow/rules/targets.smk", "    # Methods.\n", f"    {files}\n")
    append("workflow/report/load_study.rst", caption)
    append("workflow/report/load_study_table.rst", caption)

    project.configure(lambda settings: settings.update(targets=["load_study"]))
    rules = {"compute_load_study", "load_study_table", "draw_load_study"}
    assert project.rules("-j2") == {"compile_kernels", *rules}
    assert len((project / "results/load_study.csv").read_text().splitlines()) == 3
    assert (project / "results/figures/load_study.png").stat().st_size > 1000
    project.snakemake("--report", "report.html")
    assert "From rest, at tuning 0.75." in (project / "report.html").read_text(encoding="utf-8")
    append("gearlib/figures/load_study_figure.py", "\n# one more line\n")
    assert project.planned() == {"draw_load_study"}
    project.configure(lambda settings: settings.update(load_study={"tuning": 0.8}))
    assert project.planned() == rules
    project.configure(lambda settings: settings.update(load_study={"tuned": 0.8}))
    refusal = project.snakemake("-n", succeed=False)
    assert "load_study.tuned = 0.8 is not a known key" in refusal
