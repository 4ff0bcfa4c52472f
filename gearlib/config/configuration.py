"""The whole configuration: its sections, and what must agree between them."""

from typing import Any, Literal, get_args

from pydantic import Field, field_validator, model_validator

from gearlib import checks
from gearlib.config import experiments as e
from gearlib.config import measured_description, targets
from gearlib.config import types as t
from gearlib.config.gear_pair_section import Damping, GearPairSection, Run, SixDegrees
from gearlib.config.gears_section import Gears, HarrisMap, MeshStiffness
from gearlib.config.tolerances_section import Tolerances
from gearlib.config.train_section import PAIR_TRAINS, Campbell, Reducer, Train, TrainSweep
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
#: Folders of results; a project cannot have such a name.
FOLDERS = {
    *("figures", "tables", "logs", "benchmarks", "report", "resonance", "phase_planes", "scenes"),
    *("labels", "branches", "nonlinear_damping", "models", "failures", "work_precision"),
    *("measured", "tolerances"),
}
#: Limits on the samples of all phase planes and the runs of all resonance sweeps, which catch a
#: mistyped step or count.
MAX_SAMPLES, MAX_RUNS = 40_000_000, 10_000_000
_ProjectName = t.text("a text of up to 40 letters, digits, _, -", pattern="^[A-Za-z0-9_-]{0,40}$")
_Path = t.text("a path of a YAML file", pattern=r"\.ya?ml$")


class Config(Section):
    """The configuration of the workflow."""

    # Each section is described by its own docstring.
    targets: Distinct[Target] = entry(
        "Targets that `snakemake` computes and draws by default. Fig. 3 shows labels, branches and "
        "tongues if labels, branches and parametric_resonance are among them.",
        [name for name in TARGETS if name not in targets.ONLY_IF_NAMED],
    )
    project: _ProjectName = entry(
        "Name of the folder of results, results/<project>/; empty for the paper. Default: "
        "the name of the file given by --configfile, if it describes other gears.",
        "",
    )
    compare: list[_ProjectName] = entry(
        "Other projects or cases, such as `paper`, with whose resonance the target `compare` "
        "compares this one.",
        [],
    )
    measured: list[_Path] = entry(
        "YAML files of measured data sets, drawn over Fig. 3 and time histories, and scored.", []
    )
    # `gear_pair` is derived from `gears` where the gears are drawn; only `gear_pair` is dumped.
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
    def _refuse_comparison(cls, target_names: object) -> object:
        """Refuse the target "compare" in the list of targets, because it must be called by name."""
        if isinstance(target_names, list) and "compare" in target_names:
            raise ValueError(
                f"targets[{target_names.index('compare')}] = 'compare' is not allowed: it must be "
                "left out, and called by its name, snakemake -j2 compare"
            )
        return target_names

    @model_validator(mode="after")
    def _check(self) -> "Config":
        """Check keys that depend on several sections."""
        allowed = f"another name, the paper's results have a folder results/{self.project}/"
        checks.require(self.project not in FOLDERS, "project", self.project, allowed)
        for name, scene in self.scenes.items():
            config_key, periods_shown = f"scenes.{name}.periods_shown", scene.periods_shown
            allowed = f"an integer from 1 to the {self.record_periods} recorded mesh periods"
            checks.require(periods_shown <= self.record_periods, config_key, periods_shown, allowed)
        # A phase lag needs about eight samples in each period of the highest harmonic.
        max_harmonics = self.run.samples_per_period // 8
        allowed = f"an integer from 1 to run.samples_per_period / 8 = {max_harmonics}"
        harmonics = self.phase_lag.harmonics
        checks.require(harmonics <= max_harmonics, "phase_lag.harmonics", harmonics, allowed)
        self._check_sizes()
        measured_description.sets(self.measured)
        # Only the workflow computes targets; commands accept any train beside a gear pair.
        if self.gears and (messages := self.refusals()):
            raise ValueError("\n".join(messages))
        return self

    def _check_sizes(self) -> None:
        """Refuse numbers of jobs, runs or samples that are too large to be intended."""
        damping_count, resonance, run = len(self.dampings), self.resonance, self.run
        tuning_range = resonance.stop - resonance.start
        runs = damping_count * len(resonance.directions) * tuning_range / resonance.step
        allowed = f"larger: {runs:,.0f} runs in all are more than {MAX_RUNS:,}"
        checks.require(runs <= MAX_RUNS, "resonance.step", resonance.step, allowed)
        windows = damping_count * tuning_range / resonance.window
        allowed = f"larger: {windows:,.0f} jobs are more than {t.MAX_JOBS:,}"
        checks.require(windows <= t.MAX_JOBS, "resonance.window", resonance.window, allowed)
        planes = damping_count * len(self.phase_planes.tunings)
        if planes > t.MAX_JOBS:
            raise ValueError(
                f"phase_planes.tunings has {planes // damping_count:,} entries: there must be "
                f"from 1 to {t.MAX_JOBS // damping_count:,} to stay within {t.MAX_JOBS:,} jobs"
            )
        samples = planes * self.record_periods * run.samples_per_period
        allowed = f"smaller: {samples:,} samples of all phase planes are more than {MAX_SAMPLES:,}"
        fits = samples <= MAX_SAMPLES
        checks.require(fits, "run.samples_per_period", run.samples_per_period, allowed)

    def refusals(self) -> list[str]:
        """Return an error message for each reason why these gears cannot have some targets."""
        names = self.targets if "targets" in self.model_fields_set else self._changed_targets()
        targets_by_reason: dict[str, list[str]] = {}
        for name in names:
            targets_by_reason.setdefault(targets.refusal(name, self), []).append(name)
        return [
            targets.for_targets(reason, *names)
            for reason, names in targets_by_reason.items()
            if reason
        ]

    def without_damping(self) -> list[str]:
        """Return an error message if targets need the damping of a train that has none, else []."""
        names = [name for name in self.wanted() if name in targets.TRAIN_TARGETS]
        reason = targets.undamped(self)
        return [targets.for_targets(reason, *names)] if reason and names else []

    def _changed_targets(self) -> list[str]:
        """Return ["tolerances"] if that section differs from its default, else []."""
        default = type(self.tolerances).model_fields["parameters"].default
        tolerances = self.tolerances.model_dump(include={"parameters", "correlations"})
        changed = tolerances != {"parameters": default, "correlations": []}
        return ["tolerances"] if changed else []

    def wanted(self) -> list[str]:
        """Return the names of the targets to compute, without those that do not fit these gears."""
        names = list(self.targets)
        if "targets" not in self.model_fields_set and targets.has_own_train(self):
            names.append("train_sweep")
        if self.measured:
            names.append("measured")
        return [name for name in dict.fromkeys(names) if not targets.refusal(name, self)]

    @property
    def periods(self) -> int:
        """Mesh periods of each run."""
        return self.run.revolutions * self.gear_pair.teeth

    @property
    def record_periods(self) -> int:
        """Recorded mesh periods at the end of each run."""
        return self.run.recorded_revolutions * self.gear_pair.teeth

    def pair_parameters(self, damping: str) -> dict:
        """Return the keyword arguments of `gearlib.GearPair` for the name of a damping."""
        return self.damped_parameters(self.dampings[damping])

    def damped_parameters(self, damping: Damping) -> dict:
        """Return the keyword arguments of `gearlib.GearPair` with the coefficients of a damping."""
        return self.gear_pair.model_dump() | damping.model_dump()

    def six_degree_parameters(self) -> dict:
        """Return the keyword arguments of `gearlib.SixDegreePair` except `pair`."""
        arguments = self.six_degrees.model_dump()
        if self.gears:
            gears = self.gears.described()
            arguments["teeth"] = [gears[name]["teeth"] for name in ("pinion", "wheel")]
        return arguments

    def train_parameters(self, damping: str) -> dict:
        """Return the arguments, plain values, from which `from_values.described` makes the train.

        `damping` is the name of the damping of trains whose meshes are all the gear pair.
        """
        has_pair_meshes = self.train.kind in PAIR_TRAINS
        return {
            "kind": self.train.kind,
            "arguments": self.train.arguments(),
            "pair": self.pair_parameters(damping) if has_pair_meshes else None,
        }

    def global_parameters(self, case: Any) -> dict:
        """Return the keyword arguments of `gearlib.GearPair` for a panel of basins or sections."""
        return self.damped_parameters(case.damping) | case.change.model_dump()

    def case_parameters(self, case: Any) -> dict:
        """Return the keyword arguments of `gearlib.GearPair` for one case of a scene."""
        return self.pair_parameters(case.damping) | case.change.model_dump()

    def candidates(self, scene: e.Scene) -> list[str]:
        """Return the names of the models that can carry a scene, the smallest first."""
        if scene.model != "smallest":
            return [scene.model]
        histories = set(scene.courses)
        if histories & e.FRICTION_ONLY:
            return ["six_degrees"]
        six_degree_models = ["six_degrees_plain", "six_degrees"]
        return six_degree_models if histories & e.SIX_ONLY else ["one_degree", *six_degree_models]

    def tolerance_laws(self) -> dict:
        """Return the probability laws of the section `tolerances`, as `gearlib.scatter` takes them.

        Raise ValueError if the gears cannot have such values.
        """
        pair = self.pair_parameters(self.tolerances.damping)
        scales = PairParameters(**pair)
        values = pair | {name: getattr(scales, name) for name in RATIOS}
        if self.tolerances.of_drawing():
            values |= self.gears.described()
            for gear in ("pinion", "wheel"):
                values |= {f"{gear}.{name}": value for name, value in values[gear].items()}
        return self.tolerances.laws(values)
