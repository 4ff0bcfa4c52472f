"""What pytest-mpl compares: the figures of a run of the small workflow. See pictures.py."""

import os
import shutil
from pathlib import Path

import pytest

from tests.golden import pictures

RESULTS = Path(os.environ[pictures.VARIABLE])


class Picture:
    """A figure that is a file already; pytest-mpl asks a figure only to save itself."""

    def __init__(self, path):
        self.path = path

    def savefig(self, target, **_):
        shutil.copyfile(self.path, target)


def compared(name, path):
    """Return a figure as a parameter, with the mark that names the picture looked at last."""
    mark = pytest.mark.mpl_image_compare(filename=f"{name}.png", tolerance=0)
    return pytest.param(path, id=name, marks=mark)


@pytest.mark.parametrize("path", [compared(*item) for item in pictures.pictures(RESULTS).items()])
def test_picture(path):
    return Picture(path)
