"""What the tests of the pages share."""

import pytest

from tests.paper import CONFIG


@pytest.fixture(scope="module")
def mapping():
    """The configuration of the project."""
    return CONFIG
