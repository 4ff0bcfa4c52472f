"""Configurations as the workflow takes them: the gallery laid over config.yaml, no scenes."""

import shutil

import pytest

from tests.workflow.project import ROOT, small_project

pytestmark = pytest.mark.slow


def test_a_case_of_the_gallery_is_planned(tmp_path):
    project = small_project(tmp_path / "project")
    shutil.copy2(ROOT / "gallery.yaml", project / "gallery.yaml")
    wanted = [f"results/{case}" for case in ("fzg_c/resonance.nc", "planetary/train_sweep.nc")]
    # One damping, three directions; nothing of config.yaml.
    assert project.planned("--configfile", "gallery.yaml", "--", *wanted) == {
        "fzg_c_compile_kernels": 1,
        "fzg_c_sweep_window": 3,
        "fzg_c_gather_resonance": 1,
        "planetary_compile_train_kernels": 1,
        "planetary_compute_train_sweep": 1,
    }


def test_without_scenes_no_models_are_compared(tmp_path):
    project = small_project(tmp_path / "project")
    project.configure(lambda settings: settings.update(scenes={}))
    planned = project.planned()
    assert planned["draw_resonance"] and not {"scene", "compare_models"} & set(planned)
