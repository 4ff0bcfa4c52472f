"""Wrong input of any command: one sentence, and exit code 2."""

import itertools
import re
import socket
import warnings

import click

from gearlib.config.validation import as_typed
from gearlib.removed import REMOVED, sentence

#: Where a command keeps the texts of its options.
TYPED = "gearlib.typed"
#: What stands in the help of an option that takes one value or two.
EITHER = "TEETH | PINION WHEEL"


class Command(click.Command):
    """A command whose options of two values say so where they get fewer."""

    def parse_args(self, ctx, args):
        """Refuse fewer: click would take the next option for a value."""
        for option in (one for one in self.params if one.nargs == 2):
            for place in [i for i, text in enumerate(args) if text in option.opts]:
                given = list(itertools.takewhile(_is_value, args[place + 1 : place + 3]))
                if len(given) < 2:
                    raise click.UsageError(
                        f"{args[place]} = {' '.join(given) or None} is not allowed: it must be two "
                        f"values, {args[place]} {option.metavar}",
                        ctx,
                    )
        for option in (word.partition("=")[0] for word in args):
            if (name := f"{ctx.info_name} {option}") in REMOVED:
                raise click.UsageError(sentence(name), ctx)
        args = list(_joined(args, self.params))
        ctx.meta[TYPED] = self.make_parser(ctx).parse_args(list(args))[0]
        return super().parse_args(ctx, args)


def _joined(args, options):
    """Yield the words of a command, both values of an option of one or two as one word."""
    either = {name for one in options if one.metavar == EITHER for name in one.opts}
    words = iter(args)
    for word in words:
        yield word
        if word in either:
            first, second = next(words, None), next(words, None)
            if second is None or not _is_value(second):
                yield from (one for one in (first, second) if one is not None)
            else:
                yield f"{first} {second}"


def _is_value(text):
    """Return whether a word of the command line is no option; -0.2 and -inf are none."""
    return re.match(r"-+[A-Za-z]", text) is None or text.lower() in ("-inf", "-nan")


class Group(click.Group):
    """Commands that end with exit code 2 and a sentence where their input is wrong."""

    command_class = Command

    def invoke(self, ctx):
        """Call the command, and say what the library warns of."""
        try:
            with warnings.catch_warnings():
                warnings.showwarning = lambda text, *_: click.echo(f"Warning: {text}", err=True)
                return super().invoke(ctx)
        except ValueError as error:
            raise click.UsageError(as_typed(str(error), ctx.meta.get(TYPED, {}))) from None


def free_port(ctx, option, port):
    """Return a port of this machine, for an option of click; refuse one that is in use."""
    with socket.socket() as probe:
        # As the server does: one that was in use a moment ago is free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise click.UsageError(
                f"--port {port} is not allowed: it must be a free port from 0 to 65535, 0 for any "
                f"({error.strerror})",
                ctx,
            ) from None
    return port


def other_model(ctx, option, model):
    """Refuse any model but one pair, for an option of click of the explorer."""
    if model not in (None, "one_degree"):
        raise click.UsageError(
            f"--model {model} is not allowed: it must be left out, the explorer shows gear pairs; "
            "the functions of gearlib.plot draw gear trains",
            ctx,
        )
