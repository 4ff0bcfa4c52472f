"""Define observations (measured values and a function that predicts them) and evaluate orbits."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from gearlib.analysis.orbits.continuation import continue_orbit
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.analysis.orbits.tracing import ContinuationFailed
from gearlib.data import summary
from gearlib.data.status import OK
from gearlib.engines import orbit as orbit_columns
from gearlib.engines.summary_columns import COLUMNS
from gearlib.runs.simulation import run
from gearlib.runs.sweeping import sweep
from gearlib.uncertainty.designs import RESONANCE_NAMES

#: Residual of a measured jump speed or onset that the model does not have.
MISSING_SPEED_RESIDUAL = 100.0
#: Smallest relative change between successive measured values that counts as a jump.
MIN_RELATIVE_JUMP = 0.15
START_ERROR = (
    "model is not allowed: the fit starts from its values, but the computation of its motion failed"
)
#: Statistics of an orbit that can be compared with measured values.
STATISTICS = (
    "displacement_max",
    "displacement_min",
    "dynamic_force_max",
    "dynamic_force_min",
    "fraction_drive",
    "contact_loss_fraction",
    "fraction_coast",
)
#: Names of two further quantities: load sharing of a mesh, amplitude of a mesh order.
LOAD_SHARING, ORDER_AMPLITUDE = "load_sharing", "order_amplitude"
#: Samples of a mesh period from which mesh orders are computed.
SAMPLES_PER_PERIOD = 64
#: Ends of the branch on which jumps are searched for, relative to the highest and lowest jump
#: speed.
_BRANCH_START_RATIO, _BRANCH_END_RATIO = 1.5, 0.7
#: Speeds at which the onset of contact loss is searched for, relative to the measured onset.
_ONSET_SPEED_RATIOS = np.linspace(0.7, 1.3, 61)
#: Arguments of `sweep` for which the motion settles on an orbit at each speed.
SETTLING_SWEEP = {"periods": 200, "record_periods": 1}


class Channel(NamedTuple):
    """Measured values of one sensor and their standard deviations."""

    name: str
    values: np.ndarray
    deviations: np.ndarray  #: standard deviations; only their ratios matter if the noise is unknown
    noise_known: bool
    unknown_gain: bool = False
    unknown_offset: bool = False
    #: Indices of successive values over speed or time, one sequence per row, or None.
    sequence_indices: Any = None
    #: Whether its residuals have the same weight as those of the previous channel.
    shares_weight: bool = False

    @property
    def eliminated(self) -> int:
        """Return the number of sensor constants (gain, offset) that are fitted to the data."""
        return self.unknown_gain + self.unknown_offset

    def signal_and_gain(self, predicted: np.ndarray) -> tuple[np.ndarray, float]:
        """Return (sensor signal, (n,), gain of the sensor) for predicted physical values, (n,).

        The signal is gain times value plus offset. An unknown gain or offset is fitted to the
        measured values by linear least squares (variable projection, Golub and Pereyra 1973);
        otherwise they are 1 and 0.
        """
        columns = []
        if self.unknown_gain:
            columns.append(predicted)
        if self.unknown_offset:
            columns.append(np.ones(predicted.size))
        if not columns:
            return predicted, 1.0
        known_part = 0.0 if self.unknown_gain else predicted
        matrix = np.stack(columns, axis=1) / self.deviations[:, None]
        # Columns of equal norm make the least-squares problem well-conditioned.
        norms = np.linalg.norm(matrix, axis=0)
        norms[norms == 0.0] = 1.0
        target = (self.values - known_part) / self.deviations
        coefficients = np.linalg.lstsq(matrix / norms, target, rcond=None)[0] / norms
        gain = float(coefficients[0]) if self.unknown_gain else 1.0
        return known_part + np.stack(columns, axis=1) @ coefficients, gain


class Prediction(NamedTuple):
    """Values that a model predicts for an observation."""

    values: list  #: arrays of values, one for each channel
    backlash_excursion: float  #: largest excursion into the backlash, m; 0 without contact loss


class Observation(NamedTuple):
    """A part of a measured data set and the function that predicts it."""

    kind: str  #: name in messages, such as "run-up"
    channels: list  #: of `Channel`
    predict: Callable  #: model -> `Prediction`
    make_curves: Callable  #: predicted sensor signals -> list of `Curve` or `MeasuredSpeed`
    warning: str = ""

    def predicted_signals(self, model: Any) -> list | None:
        """Return the predicted sensor signal of each channel (sensor), or None if a run fails.

        `model` predicts the measured quantities; unknown gains and offsets of the sensors are
        fitted to the measured values.
        """
        try:
            prediction = self.predict(model)
        except (NoOrbit, ContinuationFailed, ArithmeticError, ValueError):
            return None
        channel_values = zip(self.channels, prediction.values, strict=True)
        return [channel.signal_and_gain(values)[0] for channel, values in channel_values]

    def residuals(self, model: Any) -> np.ndarray | None:
        """Return the residuals of all channels (sensors), (n,), or None if a run fails.

        A residual is (predicted - measured value) / standard deviation, and 100 for the speed of a
        jump that the model does not have.
        """
        signals = self.predicted_signals(model)
        if signals is None:
            return None
        residuals = []
        for channel, signal in zip(self.channels, signals, strict=True):
            residuals.append((signal - channel.values) / channel.deviations)
        # The speed of a jump that the model does not have is NaN.
        return np.nan_to_num(np.concatenate(residuals), nan=MISSING_SPEED_RESIDUAL)


class Curve(NamedTuple):
    """A measured and a fitted quantity over the speed or over the mesh phase."""

    name: str
    units: str
    x_name: str  #: "speed" in rpm or "phase" in mesh periods
    x: np.ndarray  #: abscissae, (n,)
    values: tuple  #: measured and fitted sensor signals, each (n,); NaN: not compared
    speed_falls: np.ndarray  #: whether the speed falls, (n,); False over the phase


class MeasuredSpeed(NamedTuple):
    """The measured and the fitted speed of a jump or of the onset of contact loss, rpm."""

    name: str
    measured: float
    deviation: float  #: standard deviation of the measured speed
    fitted: float  #: NaN if the model does not have it


def orbit_quantities(model: Any, speed: float, guess: Any, samples_per_period: int = 1) -> dict:
    """Return the quantities of the periodic orbit at a speed in rpm, name -> values of each mesh.

    Quantities, in SI units, are extrema of displacement and force, fractions of contact time, and
    others. "order_amplitude" has the complex Fourier coefficients of the displacements in m at
    multiples of the mesh frequency, (orders, meshes), starting at order 0; their moduli are half
    the amplitudes. `guess` is the initial state for the search of the orbit; `samples_per_period`
    is the number of samples per mesh period. Raise `NoOrbit` if the search or the run fails.
    """
    orbit = periodic_orbit(model, speed / float(model.speed(1.0)), guess=guess)
    periods = orbit.period  # number of mesh periods
    options = {"periods": periods, "record_periods": periods, "initial_state": tuple(orbit.state)}
    record = run(model, orbit.tuning, samples_per_period, **options)
    if record.status:
        raise NoOrbit(f"the run at {speed:g} rpm failed")
    tables = {"table": record.summary, "final_states": record.final, "record_periods": periods}
    tables["periods_and_statuses"] = np.array([periods, OK])  # a row: period of the orbit, status
    variables = summary.summary_variables(model, dims=(), **tables)
    scales = {"static_deflection": model.static_deflection, "force_scale": model.load}
    column_scales = {column.name: column.scale for column in COLUMNS}
    quantities = {
        name: np.atleast_1d(values) * scales.get(column_scales.get(name, ""), 1.0)
        for name, (_, values) in variables.items()
    }
    # Each mesh has a group of columns in the table of samples; take the displacement of each.
    end = max(len(model.mesh_names), 1) * orbit_columns.SAMPLE_COLUMNS
    columns = slice(orbit_columns.SAMPLE_X, end, orbit_columns.SAMPLE_COLUMNS)
    displacements = record.samples[:, columns] * model.static_deflection
    coefficients = np.fft.rfft(displacements, axis=0, norm="forward")
    return quantities | {ORDER_AMPLITUDE: coefficients[::periods]}


def mesh_quantity(quantities: dict, name: str, mesh: int) -> float:
    """Return a quantity of one mesh, such as "displacement_max" or "order_amplitude_2", SI units.

    `quantities` maps names to the values of each mesh on an orbit, as returned by
    `orbit_quantities`; `mesh` is the index of the mesh. An order amplitude is the amplitude of the
    displacement at a multiple of the mesh frequency.
    """
    kind, _, number = name.rpartition("_")
    if kind == ORDER_AMPLITUDE:
        # A real amplitude is twice the modulus of the complex coefficient.
        return 2.0 * abs(quantities[ORDER_AMPLITUDE][int(number), mesh])
    return float(quantities[name][mesh])


def resonance_speeds(model: Any, measured: dict) -> dict:
    """Return the jump speeds and the onset of contact loss of a model, name -> speed in rpm.

    At a jump the motion changes suddenly to another orbit while the speed increases or decreases.
    `measured` maps the names of the speeds to compute ("jump_up", "jump_down",
    "onset_of_contact_loss") to their measured values in rpm. Speeds that the model does not have
    are omitted.
    """
    # `main_resonance` needs one coordinate and an excitation that repeats every mesh period. The
    # jumps of other models are folds of their branch of orbits.
    if model.size == 2 and model.repeats == 1:
        resonance = main_resonance(model, [RESONANCE_NAMES[name] for name in measured])
        if resonance.failed:
            raise ContinuationFailed
        resonance_speed = float(model.speed(1.0))  # speed at the tuning 1, rpm
        speeds = {
            name: resonance_speed * getattr(resonance, RESONANCE_NAMES[name]) for name in measured
        }
    else:
        jumps = {name: speed for name, speed in measured.items() if name.startswith("jump")}
        speeds = fold_speeds(model, jumps) if jumps else {}
        if "onset_of_contact_loss" in measured:
            speeds["onset_of_contact_loss"] = _onset_speed(model, measured["onset_of_contact_loss"])
    return {name: speed for name, speed in speeds.items() if np.isfinite(speed)}


def fold_speeds(model: Any, measured: dict) -> dict:
    """Return the speeds in rpm of the folds of a model that are closest to measured jumps.

    At a fold, a turning point of the branch of periodic orbits over the speed, the motion jumps to
    another orbit. `measured` maps "jump_up" and "jump_down" to speeds in rpm; the result has the
    same keys, except for jumps that the model does not have.
    """
    resonance_speed = float(model.speed(1.0))
    speeds = {}
    orbit = periodic_orbit(model, _BRANCH_START_RATIO * max(measured.values()) / resonance_speed)
    branch = continue_orbit(orbit, to=_BRANCH_END_RATIO * min(measured.values()) / resonance_speed)
    folds = branch.tuning.values[branch.label.values == FOLD] * resonance_speed
    # The branch starts at higher speeds, so the first fold of each pair is the jump down.
    pair_count = folds.size // 2
    fold_pairs = folds[: 2 * pair_count].reshape(pair_count, 2)
    for name, speed in measured.items():
        candidates = fold_pairs[:, 0 if name == "jump_down" else 1]
        if candidates.size:
            speeds[name] = float(candidates[np.abs(candidates - speed).argmin()])
    return speeds


def _onset_speed(model: Any, measured: float) -> float:
    """Return the speed in rpm at which a model starts or ceases to lose contact.

    It is the speed closest to the `measured` one, or NaN if there is none within 30 %. A sweep over
    the speed brackets it, and exact orbits determine its value.
    """
    speeds = measured * _ONSET_SPEED_RATIOS
    curve = sweep(model, speeds / float(model.speed(1.0)), direction="up", **SETTLING_SWEEP)
    # At the onset the smallest clearance of all meshes passes 0.
    clearances = model.clearances(curve.displacement_min.values, curve.displacement_max.values)
    minima = clearances.reshape(speeds.size, -1).min(axis=1)
    crossings = np.flatnonzero((minima[1:] > 0.0) != (minima[:-1] > 0.0))
    if not crossings.size:
        return math.nan
    i = crossings[np.abs(speeds[crossings] - measured).argmin()]
    state = curve.final_state.values[i]

    def smallest_clearance(speed: float) -> float:
        """Return the smallest clearance of all meshes on the orbit at a speed in rpm, m.

        It is negative if contact is lost.
        """
        return _clearances(model, orbit_quantities(model, speed, state)).min()

    bracket = speeds[i], speeds[i + 1]
    return brentq(smallest_clearance, *bracket, xtol=1e-12 * measured, rtol=1e-14)


def _clearances(model: Any, quantities: Any) -> np.ndarray:
    """Return the distances of the loaded flanks from loss of contact in m, one for each mesh.

    They are negative if contact is lost. `quantities` has the extrema of an orbit, displacement_min
    and displacement_max, in m.
    """
    length = model.static_deflection
    minima = np.asarray(quantities["displacement_min"]) / length
    maxima = np.asarray(quantities["displacement_max"]) / length
    return model.clearances(minima, maxima) * length


def backlash_excursion(model: Any, quantities: Any) -> float:
    """Return the largest displacement into the backlash of any mesh in m, 0 without contact loss.

    `quantities` has the extrema of an orbit, displacement_min and displacement_max, in m.
    """
    return abs(float(_clearances(model, quantities).min(initial=0.0)))
