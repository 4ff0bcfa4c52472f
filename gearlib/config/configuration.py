"""The whole configuration: its sections, and what must agree between them."""

from typing import Literal, get_args

from pydantic import Field, field_validator, model_validator

from gearlib.config import measured_description
from gearlib.config.experiments import (
    FRICTION_ONLY,
    SIX_ONLY,
    AnalyticMethod,
    Basins,
    Bifurcation,
    Branches,
    Certificates,
    Figures,
    Jump,
    Labels,
    Models,
    NonlinearDamping,
    ParametricResonance,
    PhaseLag,
    PhasePlanes,
    Poincare,
    Resonance,
    RunUps,
    Scene,
)
from gearlib.config.gear_pair_section import Damping, GearPairSection, Run, SixDegrees
from gearlib.config.gears_section import Gears, HarrisMap, MeshStiffness
from gearlib.config.measured_description import MeasuredPath
from gearlib.config.targets import (
    OF_ANY_TRAIN,
    ONLY_IF_NAMED,
    for_targets,
    has_own_train,
    refusal,
    undamped,
)
from gearlib.config.tolerances_section import Tolerances
from gearlib.config.train_section import OF_PAIRS, Campbell, Reducer, Train, TrainSweep
from gearlib.config.trials import Failures, StabilityChart, WorkPrecision
from gearlib.config.types import (
    MAX_JOBS,
    Name,
    ProjectName,
    Section,
    check_different,
    check_most,
    entry,
    listing,
)
from gearlib.models.pair_parameters import RATIOS, PairParameters

#: Limits that catch a mistyped step or window before it fills a disk.
MAX_TUNINGS = 10_000_000
MAX_SAMPLES = 40_000_000

Target = Literal[
    *("phase_lag", "resonance", "run_ups", "phase_planes", "scenes", "claims", "jump", "labels"),
    *("branches", "certificates", "nonlinear_damping", "models", "parametric_resonance"),
    *("basins", "bifurcation", "poincare", "analytic_method", "stability_chart", "failures"),
    *("work_precision", "reducer", "campbell", "train_sweep", "mesh_stiffness", "harris_map"),
    *("measured", "tolerances"),
]
TARGETS = get_args(Target)

#: Folders of results, whose names a project cannot have.
FOLDERS = {
    *("figures", "tables", "logs", "benchmarks", "report", "resonance", "phase_planes", "scenes"),
    *("labels", "branches", "nonlinear_damping", "models", "failures", "work_precision"),
    *("measured", "tolerances"),
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


class Config(Section):
    """The configuration of the workflow."""

    # Each section is described by its own docstring.
    targets: listing(
        Target,
        "What `snakemake` without a target computes and draws. Fig. 3 shows labels, branches and "
        "tongues where labels, branches and parametric_resonance are among them.",
    ) = [name for name in TARGETS if name not in ONLY_IF_NAMED]
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
    phase_lag: PhaseLag
    resonance: Resonance = Resonance.unchecked()
    run_ups: RunUps
    phase_planes: PhasePlanes = PhasePlanes.unchecked()
    jump: Jump
    labels: Labels = Labels.unchecked()
    branches: Branches
    certificates: Certificates = Certificates.unchecked()
    nonlinear_damping: NonlinearDamping
    models: Models = Models.unchecked()
    parametric_resonance: ParametricResonance = ParametricResonance.unchecked()
    basins: Basins
    bifurcation: Bifurcation
    poincare: Poincare
    analytic_method: AnalyticMethod
    stability_chart: StabilityChart
    failures: Failures = Failures.unchecked()
    work_precision: WorkPrecision
    reducer: Reducer
    campbell: Campbell = Campbell.unchecked()
    train_sweep: TrainSweep
    mesh_stiffness: MeshStiffness = MeshStiffness.unchecked()
    harris_map: HarrisMap = HarrisMap.unchecked()
    tolerances: Tolerances

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
        if self.project in FOLDERS:
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
            found.setdefault(refusal(name, self), []).append(name)
        return [for_targets(words, *names) for words, names in found.items() if words]

    def without_damping(self):
        """Return a sentence, or none, that asks for the damping of a train that targets move."""
        moved = [name for name in self.wanted() if name in OF_ANY_TRAIN]
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
        return [name for name in asked if not refusal(name, self)]

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

    def tolerance_laws(self):
        """Return the laws of what scatters, arguments of `gearlib.scatter`.

        ValueError where the gears cannot have them.
        """
        pair = self.pair_parameters(self.tolerances.damping)
        scales = PairParameters(**pair)
        values = pair | {name: getattr(scales, name) for name in RATIOS}
        if self.tolerances.of_drawing():
            gears = self.gears
            values |= {"centre_distance": gears.centre_distance, "backlash": gears.backlash}
            values["torque"] = gears.driving_torque()
            for part in ("pinion", "wheel"):
                drawing = getattr(gears, part).model_dump()
                values |= {f"{part}.{name}": value for name, value in drawing.items()}
        return self.tolerances.laws(values)
