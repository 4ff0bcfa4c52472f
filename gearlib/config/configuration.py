"""The whole configuration: its sections, and what must agree between them."""

from typing import Literal, get_args

from pydantic import Field, field_validator, model_validator

from gearlib import checks
from gearlib.config import experiments as e
from gearlib.config import measured_description, targets
from gearlib.config import types as t
from gearlib.config.gear_pair_section import Damping, GearPairSection, Run, SixDegrees
from gearlib.config.gears_section import Gears, HarrisMap, MeshStiffness
from gearlib.config.tolerances_section import Tolerances
from gearlib.config.train_section import OF_PAIRS, Campbell, Reducer, Train, TrainSweep
from gearlib.config.types import SECTION, Distinct, Name, Section, entry
from gearlib.models.pair_parameters import RATIOS, PairParameters

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
#: Largest number of samples of all phase planes, and of runs of all resonance sweeps.
MAX_SAMPLES, MAX_RUNS = 40_000_000, 10_000_000
_ProjectName = t.text("a text of up to 40 letters, digits, _, -", pattern="^[A-Za-z0-9_-]{0,40}$")
_Path = t.text("a path of a YAML file", pattern=r"\.ya?ml$")


class Config(Section):
    """The configuration of the workflow."""

    # Each section is described by its own docstring.
    targets: Distinct[Target] = entry(
        "Targets that `snakemake` without a target computes and draws. Fig. 3 shows labels, "
        "branches and tongues where labels, branches and parametric_resonance are among them.",
        [name for name in TARGETS if name not in targets.ONLY_IF_NAMED],
    )
    project: _ProjectName = entry(
        "Name of the folder of its results, results/<project>/; the paper's have none. Default: "
        "the name of the file given by --configfile, if its gears are others.",
        "",
    )
    compare: list[_ProjectName] = entry(
        "Other projects or cases, `paper` among them, whose resonance the target `compare` lays "
        "over this one.",
        [],
    )
    measured: list[_Path] = entry(
        "YAML files of measured sets that are laid over Fig. 3 and time courses, and scored.", []
    )
    # Of these two there is one; the other is made from the drawing, and dumped.
    gears: Gears = Field(default=None, exclude=True)
    gear_pair: GearPairSection
    dampings: dict[Name, Damping] = Field(min_length=1, description="Damping combinations by name.")
    run: Run = SECTION
    six_degrees: SixDegrees = SECTION
    train: Train = SECTION
    scenes: dict[Name, e.Scene] = Field(default={}, description="Scenes by name, one figure each.")
    figures: e.Figures = SECTION
    phase_lag: e.PhaseLag = SECTION
    resonance: e.Resonance = SECTION
    run_ups: e.RunUps = SECTION
    phase_planes: e.PhasePlanes = SECTION
    jump: e.Jump = SECTION
    labels: e.Labels = SECTION
    branches: e.Branches = SECTION
    certificates: e.Certificates = SECTION
    nonlinear_damping: e.NonlinearDamping = SECTION
    models: e.Models = SECTION
    parametric_resonance: e.ParametricResonance = SECTION
    basins: e.Basins = SECTION
    bifurcation: e.Bifurcation = SECTION
    poincare: e.Poincare = SECTION
    analytic_method: e.AnalyticMethod = SECTION
    stability_chart: e.StabilityChart = SECTION
    failures: e.Failures = SECTION
    work_precision: e.WorkPrecision = SECTION
    reducer: Reducer = SECTION
    campbell: Campbell = SECTION
    train_sweep: TrainSweep = SECTION
    mesh_stiffness: MeshStiffness = SECTION
    harris_map: HarrisMap = SECTION
    tolerances: Tolerances = SECTION

    @field_validator("targets", mode="before")
    @classmethod
    def _refuse_comparison(cls, targets):
        if isinstance(targets, list) and "compare" in targets:
            raise ValueError(
                f"targets[{targets.index('compare')}] = 'compare' is not allowed: it must be left "
                "out, and called by its name, snakemake -j2 compare"
            )
        return targets

    @model_validator(mode="after")
    def _check(self):
        allowed = f"another name, the paper's results have a folder results/{self.project}/"
        checks.require(self.project not in FOLDERS, "project", self.project, allowed)
        for name, scene in self.scenes.items():
            key, shown = f"scenes.{name}.periods_shown", scene.periods_shown
            allowed = f"an integer from 1 to the {self.record_periods} recorded mesh periods"
            fits = shown <= self.record_periods
            checks.require(fits, key, shown, allowed)
        # Two samples a period resolve a harmonic; its lag wants a few more.
        most = self.run.samples_per_period // 8
        allowed = f"an integer from 1 to run.samples_per_period / 8 = {most}"
        harmonics = self.phase_lag.harmonics
        checks.require(harmonics <= most, "phase_lag.harmonics", harmonics, allowed)
        self._check_sizes()
        measured_description.sets(self.measured)
        # What a train cannot be in matters to the workflow only, not to commands.
        if self.gears and (refused := self.refused()):
            raise ValueError("\n".join(refused))
        return self

    def _check_sizes(self):
        """Refuse more jobs, runs or samples than anyone asks for on purpose."""
        dampings, resonance, run = len(self.dampings), self.resonance, self.run
        range_of_tunings = resonance.stop - resonance.start
        runs = dampings * len(resonance.directions) * range_of_tunings / resonance.step
        allowed = f"larger: {runs:,.0f} runs in all are more than {MAX_RUNS:,}"
        checks.require(runs <= MAX_RUNS, "resonance.step", resonance.step, allowed)
        windows = dampings * range_of_tunings / resonance.window
        allowed = f"larger: {windows:,.0f} jobs are more than {t.MAX_JOBS:,}"
        checks.require(windows <= t.MAX_JOBS, "resonance.window", resonance.window, allowed)
        planes = dampings * len(self.phase_planes.tunings)
        if planes > t.MAX_JOBS:
            raise ValueError(
                f"phase_planes.tunings has {planes // dampings:,} entries: there must be from 1 to "
                f"{t.MAX_JOBS // dampings:,} to stay within {t.MAX_JOBS:,} jobs"
            )
        samples = planes * self.record_periods * run.samples_per_period
        allowed = f"smaller: {samples:,} samples of all phase planes are more than {MAX_SAMPLES:,}"
        fits = samples <= MAX_SAMPLES
        checks.require(fits, "run.samples_per_period", run.samples_per_period, allowed)

    def refused(self):
        """Return a sentence for each reason why targets cannot be about these gears."""
        names = self.targets if "targets" in self.model_fields_set else self._changed()
        refused = {}
        for name in names:
            refused.setdefault(targets.refusal(name, self), []).append(name)
        return [targets.for_targets(text, *those) for text, those in refused.items() if text]

    def without_damping(self):
        """Return a sentence, or none, that asks for the damping of a train that targets move."""
        names = [name for name in self.wanted() if name in targets.OF_ANY_TRAIN]
        text = targets.undamped(self)
        return [targets.for_targets(text, *names)] if text and names else []

    def _changed(self):
        """Return targets that nobody names and whose section is not the default."""
        default = type(self.tolerances).model_fields["parameters"].default
        tolerances = self.tolerances.model_dump(include={"parameters", "correlations"})
        changed = tolerances != {"parameters": default, "correlations": []}
        return ["tolerances"] if changed else []

    def wanted(self):
        """Return the targets; where none are named, those that can be about these gears."""
        names = list(self.targets)
        if "targets" not in self.model_fields_set and targets.has_own_train(self):
            names.append("train_sweep")
        if self.measured:
            names.append("measured")
        return [name for name in dict.fromkeys(names) if not targets.refusal(name, self)]

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
        arguments = self.six_degrees.model_dump()
        if self.gears:
            gears = self.gears.described()
            arguments["teeth"] = [gears[name]["teeth"] for name in ("pinion", "wheel")]
        return arguments

    def train_parameters(self, damping):
        """Return the keyword arguments of `gearlib.models.from_values.described`.

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
        return self.damped_parameters(case.damping) | case.change.model_dump()

    def case_parameters(self, case):
        """Return the keyword arguments of `gearlib.GearPair` for one case of a scene."""
        return self.pair_parameters(case.damping) | case.change.model_dump()

    def candidates(self, scene):
        """Return the models that can carry a scene, the smallest first."""
        if scene.model != "smallest":
            return [scene.model]
        courses = set(scene.courses)
        if courses & e.FRICTION_ONLY:
            return ["six_degrees"]
        six = ["six_degrees_plain", "six_degrees"]
        return six if courses & e.SIX_ONLY else ["one_degree", *six]

    def tolerance_laws(self):
        """Return the laws of what scatters, arguments of `gearlib.scatter`.

        ValueError where the gears cannot have them.
        """
        pair = self.pair_parameters(self.tolerances.damping)
        scales = PairParameters(**pair)
        values = pair | {name: getattr(scales, name) for name in RATIOS}
        if self.tolerances.of_drawing():
            values |= self.gears.described()
            for part in ("pinion", "wheel"):
                values |= {f"{part}.{name}": value for name, value in values[part].items()}
        return self.tolerances.laws(values)
