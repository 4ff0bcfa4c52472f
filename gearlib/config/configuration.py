"""The whole configuration: its sections, and what must agree between them."""

from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, create_model, field_validator, model_validator

from gearlib.config import measured_description
from gearlib.config.agreement import MAX_JOBS, check_different, check_most
from gearlib.config.experiments import Figures
from gearlib.config.gear_pair_section import Damping, GearPairSection, Run, SixDegrees
from gearlib.config.gears_section import Gears
from gearlib.config.measured_description import MeasuredPath
from gearlib.config.scenes_section import FRICTION_ONLY, SIX_ONLY, Scene
from gearlib.config.studies import STUDIES
from gearlib.config.studies.of_trains import has_own_train, undamped
from gearlib.config.studies.study import default, for_targets
from gearlib.config.train_section import OF_PAIRS, Train
from gearlib.config.types import Name, ProjectName, Section, entry, listing

#: Limits that catch a mistyped step or window before it fills a disk.
MAX_TUNINGS = 10_000_000
MAX_SAMPLES = 40_000_000

Target = Literal[tuple(STUDIES)]

#: Folders of results, whose names a project cannot have.
_FOLDERS = {"figures", "tables", "logs", "benchmarks", "report"} | {
    file.split("/")[0]
    for study in STUDIES.values()
    for job in study.jobs
    for file in job.files
    if "/" in file
}

#: Sections that name one of the dampings.
_OF_ONE_DAMPING = (
    "jump",
    "analytic_method",
    "stability_chart",
    "reducer",
    "train_sweep",
    "run_ups",
    "tolerances",
)


class _Common(Section):
    """What the studies share, and what must agree between their sections."""

    # Each section is described by its own docstring.
    targets: listing(
        Target,
        "What `snakemake` without a target computes and draws. Fig. 3 shows labels, branches and "
        "tongues where labels, branches and parametric_resonance are among them.",
    ) = [name for name, study in STUDIES.items() if study.unasked]
    project: ProjectName = entry(
        "Names the folder of its results, results/<project>/; the paper's have none. Default: "
        "the name of the file given by --configfile, if its gears are others.",
        "",
    )
    compare: list[ProjectName] = entry(
        "Other projects or cases, `paper` among them, whose resonance the target `compare` lays "
        "over this one.",
        [],
    )
    measured: list[MeasuredPath] = entry(
        "YAML files of measured sets that are laid over Fig. 3 and time courses, and scored.", []
    )
    # Of these two there is one; what is dumped has the other, made from it.
    gears: Gears = Field(default=None, exclude=True)
    gear_pair: GearPairSection
    dampings: dict[Name, Damping] = Field(
        min_length=1, description="The damping combinations, by name."
    )
    run: Run = Run.unchecked()
    six_degrees: SixDegrees
    train: Train = Train.unchecked()
    scenes: dict[Name, Scene] = Field(default={}, description="Scenes by name, one figure each.")
    figures: Figures

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    @field_validator("targets", mode="before")
    @classmethod
    def _no_comparison(cls, targets):
        if isinstance(targets, list) and "compare" in targets:
            raise ValueError(
                f"targets[{targets.index('compare')}] = 'compare' is not allowed: it must be left "
                "out, and called by its name, snakemake -j2 compare"
            )
        return targets

    @model_validator(mode="after")
    def _check(self):
        self._check_colours()
        self._check_size()
        for key in _OF_ONE_DAMPING:
            self._check_damping(key, getattr(self, key))
        self._check_damping("branches.loci", self.branches.loci)
        for name, scene in self.scenes.items():
            self._check_scene(f"scenes.{name}", scene)
        for key in ("basins", "poincare"):
            check_different(f"{key}.cases", getattr(self, key).cases, "title")
        self._check_project()
        measured_description.sets(self.measured)
        self._check_targets()
        return self

    def _check_project(self):
        if self.project in _FOLDERS:
            raise ValueError(
                f"project = {self.project!r} is not allowed: it must be another name, the paper's "
                f"results have a folder results/{self.project}/"
            )

    def _check_targets(self):
        # What a train cannot be in matters to the workflow only, not to commands.
        if self.gears and (refused := self.refused()):
            raise ValueError("\n".join(refused))

    def refused(self):
        """Return a sentence for each reason why targets cannot be about these gears."""
        found = {}
        asked = self.targets if "targets" in self.model_fields_set else self._said()
        for name in asked:
            found.setdefault(STUDIES[name].refusal(self), []).append(name)
        return [for_targets(words, *names) for words, names in found.items() if words]

    def without_damping(self):
        """Return a sentence, or none, that asks for the damping of a train that targets move."""
        moved = [name for name in self.wanted() if name in ("train_sweep", "campbell")]
        words = undamped(self)
        return [for_targets(words, *moved)] if words and moved else []

    def _said(self):
        """Return targets that nobody names and whose section says what is no default."""
        default = type(self.tolerances).model_fields["parameters"].default
        said = self.tolerances.parameters != default or self.tolerances.correlations
        return ["tolerances"] if said else []

    def wanted(self):
        """Return the targets; where none are named, those that can be about these gears."""
        asked = list(self.targets)
        if "targets" not in self.model_fields_set and has_own_train(self):
            asked.append("train_sweep")
        if self.measured:
            asked.append("measured")
        asked = dict.fromkeys(asked)
        return [name for name in asked if not STUDIES[name].refusal(self)]

    def _check_scene(self, key, scene):
        check_most(f"{key}.periods_shown", scene.periods_shown, self.record_periods)
        alien = SIX_ONLY.intersection(scene.courses)
        if scene.model == "one_degree" and alien:
            raise ValueError(
                f"{key}.courses = {sorted(alien)[0]!r} is not allowed: it must be a course of the "
                "model one_degree, or the model must be six_degrees"
            )
        alien = FRICTION_ONLY.intersection(scene.courses)
        if scene.model == "six_degrees_plain" and alien:
            raise ValueError(
                f"{key}.courses = {sorted(alien)[0]!r} is not allowed: it must be a course of the "
                "model six_degrees_plain, which has no friction, or the model must be six_degrees"
            )
        check_different(f"{key}.cases", scene.cases, "title")
        for i, case in enumerate(scene.cases):
            self._check_damping(f"{key}.cases[{i}]", case)

    def _check_damping(self, key, section):
        if section.damping not in self.dampings:
            raise ValueError(
                f"{key}.damping = {section.damping!r} is not allowed: it must be one of "
                f"{', '.join(self.dampings)}"
            )

    def _check_colours(self):
        for name, colour in self.figures.colours.items():
            if name not in self.dampings:
                raise ValueError(
                    f"figures.colours.{name} = {colour!r} is not allowed: its name must be one of "
                    f"the dampings {', '.join(self.dampings)}"
                )

    def _check_size(self):
        resonance, run = self.resonance, self.run
        span = resonance.stop - resonance.start
        copies = len(self.dampings) * len(resonance.directions)
        if copies * resonance.count() > MAX_TUNINGS:
            raise ValueError(
                f"resonance.step = {resonance.step!r} is not allowed: it must be >= "
                f"{copies * span / MAX_TUNINGS:.2g} to stay within {MAX_TUNINGS:,} runs in all"
            )
        if len(self.dampings) * span / resonance.window > MAX_JOBS:
            raise ValueError(
                f"resonance.window = {resonance.window!r} is not allowed: it must be >= "
                f"{len(self.dampings) * span / MAX_JOBS:.2g} to stay within {MAX_JOBS:,} jobs"
            )
        planes = len(self.dampings) * len(self.phase_planes.tunings)
        if planes > MAX_JOBS:
            raise ValueError(
                f"phase_planes.tunings has {len(self.phase_planes.tunings):,} entries: there must "
                f"be from 1 to {MAX_JOBS // len(self.dampings):,} to stay within {MAX_JOBS:,} jobs"
            )
        # Two samples a period resolve a harmonic; its lag wants a few more.
        if 8 * self.phase_lag.harmonics > run.samples_per_period:
            raise ValueError(
                f"phase_lag.harmonics = {self.phase_lag.harmonics} is not allowed: it must be an "
                f"integer from 1 to run.samples_per_period / 8 = {run.samples_per_period // 8}"
            )
        samples = planes * self.record_periods * run.samples_per_period
        if samples > MAX_SAMPLES:
            raise ValueError(
                f"run.samples_per_period = {run.samples_per_period} with run.recorded_revolutions "
                f"= {run.recorded_revolutions} is not allowed: the samples of all phase planes, "
                f"{samples:,}, must be <= {MAX_SAMPLES:,}"
            )

    @property
    def periods(self):
        """Mesh periods of every run."""
        return self.run.revolutions * self.gear_pair.teeth

    @property
    def record_periods(self):
        """Recorded mesh periods, the last ones of every run."""
        return self.run.recorded_revolutions * self.gear_pair.teeth

    def pair_parameters(self, damping):
        """Return the keyword arguments of `gearlib.GearPair` for one damping, by its name."""
        return self.damped_parameters(self.dampings[damping])

    def damped_parameters(self, damping):
        """Return the keyword arguments of `gearlib.GearPair` for a `Damping`."""
        return self.gear_pair.model_dump() | damping.model_dump()

    def six_degree_parameters(self):
        """Return the keyword arguments of `gearlib.SixDegreePair` beside the pair."""
        found = self.six_degrees.model_dump()
        if self.gears:
            gears = self.gears.model_dump()
            found["teeth"] = [gears[name]["teeth"] for name in ("pinion", "wheel")]
        return found

    def train_parameters(self, damping):
        """Return the keyword arguments of `gearlib.models.trains.described_train.described`.

        They are plain values; `damping` is the name of one, for the trains made of the gear pair.
        """
        of_pairs = self.train.kind in OF_PAIRS
        return {
            "kind": self.train.kind,
            "arguments": self.train.arguments(),
            "pair": self.pair_parameters(damping) if of_pairs else None,
        }

    def global_parameters(self, case):
        """Return the keyword arguments of `gearlib.GearPair` for a case of the global picture."""
        return self.damped_parameters(case.damping) | case.change.model_dump(exclude_unset=True)

    def candidates(self, scene):
        """Return the models that can carry a scene, the smallest first."""
        if scene.model != "smallest":
            return [scene.model]
        courses = set(scene.courses)
        if courses & FRICTION_ONLY:
            return ["six_degrees"]
        six = ["six_degrees_plain", "six_degrees"]
        return six if courses & SIX_ONLY else ["one_degree", *six]

    def case_parameters(self, case):
        """Return the keyword arguments of `gearlib.GearPair` for one case of a scene."""
        return self.pair_parameters(case.damping) | case.change.model_dump(exclude_unset=True)


#: With the sections of all studies.
Config = create_model(
    "Config",
    __base__=_Common,
    __doc__="The configuration of the workflow.",
    **{
        name: (study.section, default(study.section))
        for name, study in STUDIES.items()
        if study.section
    },
)
