"""Speeds on the command line: in rpm, where a command counts in tunings."""

import functools

import click
from click.core import ParameterSource

from gearlib.config import units


class _Speed(click.ParamType):
    """A speed in rpm, with or without its unit."""

    name = "rpm"

    def convert(self, value, param, ctx):
        match = units.RPM.fullmatch(str(value).strip())
        try:
            return float(match[1] if match else value)
        except ValueError:
            self.fail(f"{value!r} is no speed in rpm, such as 1500 or 1500rpm", param, ctx)


class _Tuning(click.ParamType):
    """A tuning, or a text in rpm, which `tuning_of` takes to one."""

    name = "tuning|rpm"

    def convert(self, value, param, ctx):
        if units.RPM.fullmatch(str(value).strip()):
            return value
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is no tuning, nor a speed such as 1500rpm", param, ctx)


SPEED, TUNING = _Speed(), _Tuning()
#: Where a command keeps the speed of the section `gears`, rpm, at which it runs unless told.
DRAWN = "gearlib.speed"


def options(command):
    """Give a command the options of its tuning or speed; it is called with the tuning."""

    @click.option("--tuning", type=float, help="nu = mesh / mean eigenfrequency.")
    @click.option("--speed", type=SPEED, help="Instead of it: of the gear whose teeth count, rpm.")
    @functools.wraps(command)
    def wrapped(model, tuning, speed, **others):
        from gearlib.runs import run_arguments

        if tuning is None and speed is None:
            speed = click.get_current_context().meta.get(DRAWN)
        if tuning is None and speed is None and model.speed is not None:
            raise click.UsageError("--tuning is missing: give it, or --speed, such as 3000rpm")
        return command(model=model, tuning=run_arguments.tuning_of(model, tuning, speed), **others)

    return wrapped


def tuning_of(model, name, value):
    """Return the tuning of a value of the type `TUNING`, an option of this name."""
    from gearlib.runs.run_arguments import check_speed

    if isinstance(value, str):
        return check_speed(model, name, SPEED.convert(value, None, None))
    return value


def with_drawn_speed(model, start, stop, speed=None):
    """Return the range of a sweep, and whether it is the wide default of drawn gears."""
    context = click.get_current_context()
    sources = {context.get_parameter_source(name) for name in ("start", "stop")}
    if DRAWN not in context.meta or model.size > 2 or sources != {ParameterSource.DEFAULT}:
        return start, stop, False
    speed = context.meta[DRAWN] if speed is None else speed
    given = start if speed is None else float(model.tuning_at(speed))
    return min(start, given), max(stop, given), True


def course_of(**given):
    """Return the course of a run-up from one speed to another, rows of s and rpm."""
    from gearlib.runs import run_up

    return run_up.speeds_of(**given).tolist()
