"""The record of a study: section of the configuration, computations, tables, figures, captions.

The workflow makes its rules from these records, in `workflow/rules/studies.smk`, and
`gearlib.config` its sections and targets. What depends on the configuration is a function of the
checked one, ``c``; a value that depends on what tells the jobs of a rule apart is a function of
their wildcards, as Snakemake has it. Names of results are paths below ``results``.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple

from gearlib import tunings
from gearlib.config import gear_names
from gearlib.config.gear_pair_section import BEARINGS
from gearlib.config.trials import PEERS
from gearlib.engines.pair.stiffness import force_note

#: The parts of the report, numbered because its menu is in the order of the alphabet.
PAPER, CLAIMS = "1 The paper's figures", "2 The paper's statements"
EXPLANATIONS, METHODS = "3 Explanations", "4 Methods"
TRAINS = "5 Gear trains"
DRAWN = "6 From the drawing"
MEASURED = "7 Measured"
TOLERANCES = "8 Tolerances"

#: The keys of a grid of tunings.
GRID = {"start", "stop", "step"}
#: Those of the starts of every motion.
STARTS = {"starts", "first_starts", "seed", "spread"}

#: Priority of jobs that take long: at the end of a build none of them runs alone.
LONG = 1
#: More threads than there are: Snakemake gives such a job all cores, and runs none beside it.
ALONE = 1024


class Job(NamedTuple):
    """A rule that computes: one call of the library, whose result is stored."""

    name: str  #: of the rule
    function: str  #: "module:function" of gearlib.studies, or of the package with its full name
    params: Callable = lambda c: {}  #: name of an argument -> value, which the call gets
    #: Name of an argument -> file of its dataset, or files, or a function of the configuration.
    data: dict = {}
    files: tuple = ()  #: of its results; "<name>.nc" unless said otherwise, wildcards in braces
    kernels: tuple = ("kernels",)  #: compiled before: "kernels", "larger_kernels", "train_kernels"
    methods: Callable = lambda c: ()  #: names of methods that the call loads, or a function
    given: Callable = lambda c: {}  #: name -> files of the user's that it reads, or a function
    script: str = "compute"
    threads: int = 1
    priority: int = 0


class Table(NamedTuple):
    """A rule ``<name>_table`` that writes a table, as CSV and as a page of the report."""

    name: str  #: of the CSV
    function: str  #: of gearlib.studies: column names and rows; "": its rule has its own script
    data: dict
    label: str  #: in the report
    caption: object  #: as of `text_of`
    settings: Callable = lambda c: {}  #: its other arguments
    rule: str = ""  #: where it has another name


class Drawing(NamedTuple):
    """A rule ``draw_<name>`` that draws figures, all formats at once."""

    function: str  #: of gearlib.figures; of two figures it returns them by name
    data: dict
    figure: str  #: its name
    label: object  #: in the report; or a function of the configuration and the wildcards
    caption: object  #: as of `text_of`
    settings: Callable = lambda c: {}  #: its other arguments
    absent: Callable = lambda c: []  #: methods that a note calls left out
    second: tuple = ()  #: name, label and caption of another figure
    name: str = ""  #: of the rule, where the study has several
    names: Callable = lambda c: {}  #: wildcard of the figures -> its values
    wanted: Callable = lambda c: True  #: whether there are any

    @property
    def figures(self):
        """Name -> (label, caption)."""
        first = {self.figure: (self.label, self.caption)}
        return first | ({self.second[0]: self.second[1:]} if self.second else {})


def bearings(c):
    """Return the sentence that asks for the bearings of drawn gears on six degrees, or ""."""
    return BEARINGS if c.six_degrees.bearing_stiffness is None else ""


def bearings_of_scenes(c):
    """Return the same, if any scene may be carried by six degrees of freedom."""
    models = {model for scene in c.scenes.values() for model in c.candidates(scene)}
    return bearings(c) if models - {"one_degree"} else ""


class Study:
    """One study: target ``name`` of the workflow, and section of the configuration or None.

    `part` is that of the report, `rules` are Jobs, Tables and Drawings; `results` are further files
    that the target asks for, `needs` whether a configuration has anything to study, `unasked`
    whether it is computed where none names targets, `gears` the name of those that it is about,
    `refusal` why it cannot take the gears of a configuration, in a sentence, or "". All but
    `unasked` are functions of the configuration.
    """

    def __init__(
        self,
        name,
        section,
        part,
        *rules,
        results=lambda c: [],
        needs=lambda c: True,
        unasked=True,
        gears=gear_names.of_pair,
        refusal=lambda c: "",
    ):
        self.name, self.section, self.part = name, section, part
        self.jobs = [one for one in rules if isinstance(one, Job)]
        self.tables = [one for one in rules if isinstance(one, Table)]
        self.drawings = [one for one in rules if isinstance(one, Drawing)]
        self.results, self.needs, self.unasked = results, needs, unasked
        self.gears, self.refusal = gears, refusal


def about_forces(c):
    """Return the sentence on the forces of drawn gears, "" of others."""
    return force_note(c.gear_pair.stiffness_ratio) if c.gears else ""


def for_targets(words, *names):
    """Return the sentence of a refusal with the names of the targets that it is about."""
    return f"{words}, for the target{'s' if names[1:] else ''} {listed(names)}"


def text_of(caption, c):
    """Return a caption in one line; it is a text with ``{c.jump.starts}``, or a function of c."""
    text = caption(c) if callable(caption) else caption.format(c=c)
    return " ".join(text.split())


def default(section):
    """Return the default of a section, `...` where some keys have none."""
    required = any(field.is_required() for field in section.model_fields.values())
    return ... if required else section.unchecked()


def grid_of(section, step="step"):
    """Return the tunings of a section."""
    return tunings.grid(section.start, section.stop, getattr(section, step))


def without(section, *keys):
    """Return the values of a section without those of some keys."""
    return section.model_dump(exclude={*keys})


def run_length(c):
    """Return the arguments that `sweep` and `simulate` share, as a dict."""
    state = c.run.initial_state
    return {
        "periods": c.periods,
        "record_periods": c.record_periods,
        "initial_state": [state.displacement, state.velocity],
    }


def sampled_run(c):
    """Return the arguments of `simulate` that runs with samples take, as a dict."""
    return run_length(c) | {"samples_per_period": c.run.samples_per_period}


def pairs_of(c):
    """Return damping -> parameters of the gear pair with it."""
    return {name: c.pair_parameters(name) for name in c.dampings}


def model_of(c):
    """Return the function of wildcards that gives the parameters of the model of a job."""
    return lambda wildcards: c.pair_parameters(wildcards.damping)


def each(pattern, names):
    """Return a file for each name: the pattern has one wildcard, in braces."""
    begin, end = pattern.split("{")[0], pattern.split("}")[1]
    return [f"{begin}{name}{end}" for name in names]


def of_dampings(pattern):
    """Return the function of the configuration that gives a file for each damping."""
    return lambda c: each(pattern, c.dampings)


def installed(method):
    """Return whether the package of a method is there; only peers need one."""
    return method not in PEERS or find_spec(PEERS[method]) is not None


def absent(methods):
    """Return the methods that are left out because their packages are not installed."""
    return [name for name in methods if not installed(name)]


def listed(values):
    """Return values as a text with commas."""
    return ", ".join(map(str, values))
