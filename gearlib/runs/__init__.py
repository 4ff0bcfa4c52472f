"""Runs of any model by any method: `simulate`, `sweep`, `run_up`."""
