"""Gear trains as FMUs (FMI 3.0, Co-Simulation), which run without Python: `write_fmu`."""

from gearlib.fmu.writer import write_fmu

__all__ = ["write_fmu"]
