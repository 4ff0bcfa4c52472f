"""The statement on the whole reducer, of which the paper studies one mesh, and its rule."""

from gearlib.studies import claims
from gearlib.studies.claims.data import NoData

_CASES = {
    "in_phase": "branches in phase and held alike",
    "disturbed": "starts beside",
    "out_of_phase": "branches out of phase",
    "pin_error": "one axis displaced",
    "soft_supports": "soft supports",
}
_MODELS = {
    "pair": "the pair alone",
    "pair_in_train": "the pair with its share of the input gear",
    "two_meshes": "the two meshes of one branch",
    "torsional": "the torsional train",
    "whole": "the whole train",
}
#: Whose resonances are named.
_SHOWN = ("pair", "pair_in_train", "whole")


def one_mesh(found):
    """Return whether the pair suffices, and in words which model does; see `statements`."""
    if found.dynamic_factor.isnull().any():
        raise NoData("some of the runs could not go on")
    base = found.sel(case=found.case.values[0])
    peaks = base.answer.sel(observable="peak_tuning")
    shared = base.answer_shared.sel(observable="peak_tuning")
    words = ", ".join(
        f"{_MODELS[name]} {float(peaks.sel(model=name)):.4g}"
        if int(shared.sel(model=name))
        else f"{_MODELS[name]} not the same from all starts"
        for name in _SHOWN
    )
    words = f"largest dynamic factor, {_CASES[base.case.item()]}, at nu = {words}; "
    words += (
        f"smallest model within {float(found.tolerance):g} of the whole train from all starts, "
    )
    suffices = zip(found.case.values, found.sufficient.values, strict=True)
    words += "; ".join(f"{_CASES[case]}: {_MODELS[name]}" for case, name in suffices)
    # The most favourable case counts: with it the replacement stands or falls.
    return base.sufficient.item() == "pair", words


#: As in `statements`.
CHECK = (
    "A1",
    "(assumed, not stated) one mesh of one branch stands for the whole reducer",
    "Fig. 1 a, Eq. (3)",
    "Fig. 1",
    one_mesh,
)


def rows(comparison):
    """Return the claim A1 on a comparison of `one_mesh`, as `claims.rows` has the paper's."""
    return claims.rows([claims.judge(CHECK, comparison)])
