"""The whole configuration: its sections, and checks that their values are compatible."""

from typing import Any, Literal, get_args

from pydantic import Field, model_validator

from gearlib import checks
from gearlib.config import experiments as e
from gearlib.config import measured_description, targets
from gearlib.config import types as t
from gearlib.config.experiments import FRICTION_HISTORIES, SIX_DEGREE_HISTORIES
from gearlib.config.gear_pair_section import (
    Damping,
    GearPairSection,
    Profile,
    Run,
    SixDegrees,
)
from gearlib.config.gears_section import DynamicFactor, Gears, HarrisMap, MeshStiffness
from gearlib.config.tolerances_section import Tolerances
from gearlib.config.train_section import (
    PAIR_TRAINS,
    Campbell,
    GearboxSection,
    Reducer,
    Train,
    TrainSweep,
)
from gearlib.config.types import MAX_JOBS, SECTION, Distinct, Name, Section, field
from gearlib.models.pair_parameters import RATIOS, PairParameters

Target = Literal[
    *("phase_lag", "resonance", "run_ups", "phase_planes", "scenes", "claims", "jump", "labels"),
    *("branches", "certificates", "nonlinear_damping", "models", "parametric_resonance"),
    *("basins", "bifurcation", "poincare", "analytic_method", "stability_chart", "failures"),
    *("work_precision", "reducer", "campbell", "train_sweep", "mesh_stiffness", "harris_map"),
    "dynamic_factor",
    *("measured", "tolerances", "gearbox"),
]
TARGETS = get_args(Target)
#: Largest number of samples of all phase planes, and of runs of all resonance sweeps.
MAX_SAMPLES, MAX_RUNS = 40_000_000, 10_000_000
_Path = t.text("the path of a YAML file", pattern=r"\.ya?ml$")


def _check_count(key: str, value: Any, fault: str, count: float, max_count: int, unit: str) -> None:
    """Raise an error if the value of `key` leads to a `count` above `max_count`.

    `unit` says what is counted, e.g. "runs"; `fault` is "small" if a larger value lowers the count,
    else "large".
    """
    if count > max_count:
        limit = f"{count:,.0f} {unit}, but at most {max_count:,} are allowed"
        raise checks.InputError(key, problem=f"= {value!r} is too {fault}: it leads to {limit}")


class Config(Section):
    """The configuration of the workflow."""

    # The docstring of each section class is its description.
    targets: Distinct[Target] = field(
        "Targets that `snakemake` computes and draws by default. Fig. 3 shows labels, branches and "
        "tongues if labels, branches and parametric_resonance are among the targets.",
        [name for name in TARGETS if name not in targets.ONLY_IF_NAMED],
    )
    measured: list[_Path] = field(
        "YAML files that describe measured data sets, which are compared with the model.", []
    )
    # If `gears` is given, `gear_pair` is derived from it, and only `gear_pair` is dumped.
    gears: Gears = Field(default=None, exclude=True)
    gear_pair: GearPairSection
    profile: Profile = field(
        "Mesh stiffness over the phase, scaled to the mean stiffness of gear_pair. Default: the "
        "rectangle of gear_pair.",
        None,
    )
    dampings: dict[Name, Damping] = Field(min_length=1, description="Damping combinations by name.")
    run: Run = SECTION
    six_degrees: SixDegrees = SECTION
    train: Train = SECTION
    scenes: dict[Name, e.Scene] = Field(default={}, description="Scenes by name; each is a figure.")
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
    dynamic_factor: DynamicFactor = SECTION
    tolerances: Tolerances = SECTION
    gearbox: GearboxSection = field("A gearbox in a REXS file, for the target gearbox.", None)

    @model_validator(mode="after")
    def _check(self) -> "Config":
        """Raise ValueError if values in different sections are not compatible; return `self`."""
        for name, scene in self.scenes.items():
            config_key, periods_shown = f"scenes.{name}.periods_shown", scene.periods_shown
            allowed = f"an integer from 1 to the {self.record_periods} recorded mesh periods"
            checks.require(periods_shown <= self.record_periods, config_key, periods_shown, allowed)
        # About eight samples per period of a harmonic are needed to measure its phase.
        max_harmonics = self.run.samples_per_period // 8
        allowed = f"an integer from 1 to run.samples_per_period / 8 = {max_harmonics}"
        harmonics = self.phase_lag.harmonics
        checks.require(harmonics <= max_harmonics, "phase_lag.harmonics", harmonics, allowed)
        self._check_sizes()
        if self.profile and self.gears:
            allowed = "omitted if gears are given, whose stiffness is computed from the geometry"
            raise checks.InputError("profile", self.profile.kind, allowed)
        measured_description.read_sets(self.measured)  # called only to raise errors
        # The workflow, which computes the targets, calls `target_errors` itself. If the gears are
        # given by geometry, the errors are also raised here, so that all commands report them.
        messages = self.target_errors() if self.gears else []
        if messages:
            raise ValueError("\n".join(messages))
        return self

    def _check_sizes(self) -> None:
        """Raise ValueError if the resonance sweeps or the phase planes are too expensive.

        The numbers of runs, samples and jobs are limited. A job is one process of the workflow: in
        the resonance sweep it computes one window of tunings (mesh frequency over natural
        frequency), otherwise one phase plane.
        """
        damping_count, resonance, run = len(self.dampings), self.resonance, self.run
        tuning_range = resonance.stop - resonance.start
        run_count = damping_count * len(resonance.directions) * tuning_range / resonance.step
        _check_count("resonance.step", resonance.step, "small", run_count, MAX_RUNS, "runs")
        window_count = damping_count * tuning_range / resonance.window
        _check_count("resonance.window", resonance.window, "small", window_count, MAX_JOBS, "jobs")
        tuning_count = len(self.phase_planes.tunings)
        plane_count = damping_count * tuning_count
        if plane_count > MAX_JOBS:
            raise ValueError(
                f"phase_planes.tunings has {tuning_count:,} entries, but at most "
                f"{MAX_JOBS // damping_count:,} are allowed: each is a job for each damping"
            )
        samples = run.samples_per_period
        sample_count = plane_count * self.record_periods * samples
        unit = "samples of phase planes"
        _check_count("run.samples_per_period", samples, "large", sample_count, MAX_SAMPLES, unit)

    def target_errors(self) -> list[str]:
        """Return an error message for each reason why requested targets cannot be computed.

        A target is a result that the workflow computes, e.g. "resonance". Each message names all
        targets excluded for the same reason. If the file lacks the key `targets`, default targets
        that cannot be computed are skipped silently, but tolerances given by the user are checked.
        """
        target_names = self.targets
        if "targets" not in self.model_fields_set:
            # A user who gives tolerances expects them to be used, so they must be valid.
            default_parameters = type(self.tolerances).model_fields["parameters"].default
            tolerances = self.tolerances.model_dump(include={"parameters", "correlations"})
            is_default = tolerances == {"parameters": default_parameters, "correlations": []}
            target_names = [] if is_default else ["tolerances"]
        targets_by_reason: dict[str, list[str]] = {}
        for name in target_names:
            reason = targets.refusal_reason(name, self)
            if reason:
                targets_by_reason.setdefault(reason, []).append(name)
        return [targets.append_target_names(*item) for item in targets_by_reason.items()]

    def train_damping_errors(self) -> list[str]:
        """Return a list with one error message if a mesh of the train lacks a required damping.

        The list is empty if all meshes have a damping, or if no target of gear trains, such as the
        sweep over speed, is to be computed.
        """
        names = [name for name in self.computed_targets() if name in targets.TRAIN_TARGETS]
        reason = targets.mesh_damping_error(self)
        return [targets.append_target_names(reason, names)] if reason and names else []

    def computed_targets(self) -> list[str]:
        """Return the names of the targets to compute, without those that the gears do not allow.

        If the user has described a train, its sweep over speed is added to the default targets. If
        the configuration lists measured data, the comparison with them is added.
        """
        names = list(self.targets)
        if "targets" not in self.model_fields_set and targets.has_custom_train(self):
            names.append("train_sweep")
        if self.measured:
            names.append("measured")
        return [name for name in dict.fromkeys(names) if not targets.refusal_reason(name, self)]

    @property
    def periods(self) -> int:
        """Number of mesh periods of each run."""
        return self.run.revolutions * self.gear_pair.teeth

    @property
    def record_periods(self) -> int:
        """Number of mesh periods that are recorded at the end of each run."""
        return self.run.recorded_revolutions * self.gear_pair.teeth

    def pair_description(self, damping: str | Damping | None = None, change: Any = None) -> dict:
        """Return a dict that describes the gear pair with one damping combination.

        It has the key "model" with the value "pair", and the arguments with which
        `from_values.build_model` builds the model. `damping` is a section with damping coefficients
        or its name in the configuration; None means no damping. If the section `change` is given,
        its values replace those of the pair.
        """
        if isinstance(damping, str):
            damping = self.dampings[damping]
        description = {"model": "pair"} | self.gear_pair.model_dump()
        if self.profile:
            description["profile"] = self.profile.model_dump()
        for section in (damping, change):
            if section is not None:
                description |= section.model_dump()
        return description

    def model_description(self, damping: str, kind: str = "", pitch_errors: bool = False) -> dict:
        """Return a dict that describes a model of the gears with the damping named `damping`.

        `kind` is the kind of model:

        - "teeth": each tooth pair has its own stiffness; default for gears given by geometry;
        - "rectangle": the mesh stiffness alternates between two values; default for other gears;
        - "six_degrees": gears on elastic bearings;
        - "train": the gear train.

        If `pitch_errors` is true, the model "teeth" includes the pitch errors of the gears.
        """
        kind = kind or ("teeth" if self.gears else "rectangle")
        if kind == "teeth":
            section = {
                "gears": self.gears.geometry_dict(),
                "damping": self.dampings[damping].configured_values(),
            }
            return {"model": "teeth", "pitch_errors": pitch_errors} | section
        if kind == "train":
            pair = self.pair_description(damping) if self.train.kind in PAIR_TRAINS else None
            return {"model": "train", "pair": pair, **self.train.description()}
        if kind == "six_degrees":
            pair = self.pair_description(damping)
            return {"model": kind, "pair": pair, **self.six_degree_parameters()}
        return self.pair_description(damping)

    def six_degree_parameters(self) -> dict:
        """Return the arguments of `gearlib.SixDegreePair` except `pair`, as a dict.

        They are the section `six_degrees` and, for gears given by geometry, the numbers of teeth.
        """
        arguments = self.six_degrees.model_dump()
        if self.gears:
            gears = self.gears.geometry_dict()
            arguments["teeth"] = [gears[name]["teeth"] for name in ("pinion", "wheel")]
        return arguments

    def candidate_models(self, scene: Any) -> list[str]:
        """Return the names of the models that can compute all time histories of a scene.

        `scene` is the section of a figure with a few runs; its `courses` are the names of the time
        histories. If the scene specifies a model, only this model is returned. Otherwise the
        simplest model comes first: "pair" has no bearing forces, and "six_degrees_plain" has
        neither run-out nor friction.
        """
        if scene.model != "smallest":
            return [scene.model]
        if FRICTION_HISTORIES & {*scene.courses}:
            return ["six_degrees"]
        models = ["six_degrees_plain", "six_degrees"]
        return models if SIX_DEGREE_HISTORIES & {*scene.courses} else ["pair", *models]

    def tolerance_distributions(self) -> dict:
        """Return the section `tolerances` as a dict of distributions for `gearlib.scatter`.

        Nominal values are taken from the gear pair or, if the tolerances apply to the geometry of
        the gears, from the geometry. Raise ValueError if a tolerance is invalid for these values.
        """
        coefficients = self.dampings[self.tolerances.damping].model_dump()
        parameters = self.gear_pair.model_dump() | coefficients
        pair = PairParameters(**parameters)
        # Tolerances may also be given for ratios, such as the damping ratio, which are computed
        # from the parameters.
        nominal_values = parameters | {name: getattr(pair, name) for name in RATIOS}
        if self.tolerances.has_geometry_parameters():
            stage = self.gears.geometry_dict()
            nominal_values |= stage
            for gear in ("pinion", "wheel"):
                nominal_values |= {f"{gear}.{key}": value for key, value in stage[gear].items()}
        return self.tolerances.distributions(nominal_values)
