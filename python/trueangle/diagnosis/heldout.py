"""What a correction by the causes found gains on runs that took no part in finding them."""

from __future__ import annotations

from ..errors import ArgumentError, TrueAngleError
from ..fitting.heldout import HeldOut, HeldOutRun, correct_held_out, folds, in_order
from ..fitting.result import FitResult
from ..simulation import Simulation
from .correction import without_terms
from .diagnose import diagnose

#: Most diagnoses: with more runs several are held out together.
MOST_DIAGNOSES = 3


def hold_out_extended(fit: FitResult, sim: Simulation) -> HeldOut:
    """As `hold_out`, with what a diagnosis of the other runs finds as terms of the correction.

    Causes, their parameters and the harmonics come from the other runs alone (three parts).

    Raises
    ------
    ArgumentError
        One run only, or none that can be held out.
    """
    runs = fit.runs
    if len(runs) < 2:
        raise ArgumentError("one run only: nothing can be held out; measure another run")
    found, left_in = [], []
    for fold in folds(len(runs), MOST_DIAGNOSES):
        train = [run for i, run in enumerate(runs) if i not in fold]
        labels = [runs[i].label or str(i + 1) for i in fold]
        try:
            result = diagnose(train, sim, gain=False)
            model = result.correction(fit.model, train)
            cleaned = without_terms([runs[i] for i in fold], model)
        except TrueAngleError as reason:
            left_in += [(label, str(reason)) for label in labels]
            continue
        for i, label, run in zip(fold, labels, cleaned, strict=True):
            after = correct_held_out(model.replace(terms=()), run, label).after
            before = correct_held_out(None, runs[i], label).before
            found.append(HeldOutRun(label, runs[i], model, before, after))
    if not found:
        raise ArgumentError(f"no run can be held out: {left_in[0][1]}")
    return HeldOut(in_order(found, runs), tuple(left_in))
