"""Tests and golden data are computed as the workflow computes, before anything loads numpy."""

import os

from gearlib import processor

os.environ.update(processor.environment_variables())
