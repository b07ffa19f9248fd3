"""Fit the calibration that ships with the weights, and tell how it does on scans that its fit left out.

    python benchmarks/flips/scan_views.py catalogue --out VIEWS/catalogue
    python benchmarks/flips/flip_table.py VIEWS/catalogue --views 1 2 3 --records catalogue.json
    python benchmarks/flips/flip_table.py VIEWS/ycb VIEWS/gso ... --views 1 2 3 --records scans.json
    python benchmarks/flips/fit_confidence.py scans.json --catalogue catalogue.json
        [--out manipose_mj/ppf_jax/weights/confidence.json] [--seed 0]

A logistic regression on all estimates; those of the catalogue count less, for its objects are what networks were
trained on. The table is of a cross-validation in ten folds of scans, drawn by the seed. Without `--out` nothing is
written.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from flip_table import Record, reliability_of, table_of
from jaxtyping import Float
from rich.console import Console
from scipy.optimize import minimize

from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.confidence import Calibration

FOLDS = 10
RIDGE = 0.001  # on the weights of scaled features
OF_CATALOGUE = 0.1  # weight of an estimate of a catalogue object


def fitted(records: Sequence[Record], weights: Float[np.ndarray, "n"]) -> Calibration:
    """The logistic regression of `right` on the features."""
    features = np.array([record.features for record in records])
    right = np.array([record.right for record in records], float)
    share = weights / weights.sum()
    mean = share @ features
    scale = np.sqrt(share @ (features - mean) ** 2)
    # What all estimates have in common, such as one cloud, has no scale.
    scale = np.where(scale < 1e-4, 1.0, scale)
    scaled = np.column_stack([(features - mean) / scale, np.ones(len(records))])
    kept = np.append(np.full(features.shape[1], RIDGE), 0.0)

    def loss(w: np.ndarray) -> tuple[float, np.ndarray]:
        z = scaled @ w
        value = share @ (np.logaddexp(0.0, z) - right * z) + kept @ w**2
        slope = scaled.T @ (share * (1 / (1 + np.exp(-z)) - right)) + 2 * kept * w
        return float(value), slope

    found = minimize(loss, np.zeros(scaled.shape[1]), jac=True, method="L-BFGS-B").x
    numbers = [tuple(round(float(v), 5) for v in row) for row in (mean, scale, found[:-1])]
    return Calibration(numbers[0], numbers[1], numbers[2], round(float(found[-1]), 5))


def cross_validated(scans: list[Record], catalogue: list[Record], seed: int) -> list[Record]:
    """The scans' records with the confidence of a fit that has not seen the scan."""
    names = sorted({record.scan for record in scans})
    order = np.random.default_rng(seed).permutation(len(names))
    fold = {names[row]: place % FOLDS for place, row in enumerate(order)}
    found: list[Record] = []
    for number in range(FOLDS):
        others = [record for record in scans if fold[record.scan] != number]
        calibration = fitted([*others, *catalogue], _weights(others, catalogue))
        own = (record for record in scans if fold[record.scan] == number)
        found += [replace(r, confidence=calibration.of_features(r.features)) for r in own]
    return found


def _weights(scans: Sequence[Record], catalogue: Sequence[Record]) -> Float[np.ndarray, "n"]:
    return np.append(np.ones(len(scans)), np.full(len(catalogue), OF_CATALOGUE))


def read_records(path: Path) -> list[Record]:
    """What `flip_table.py --records` wrote.

    Raises:
      InputError: It is no such file.
    """
    try:
        return [Record(**row) for row in json.loads(path.read_text())]
    except (OSError, ValueError, TypeError):
        raise InputError(f"{path}: no records of flip_table.py") from None


def main(argv: Sequence[str] | None = None) -> int:
    """Fit; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scans", type=Path, metavar="FILE")
    parser.add_argument("--catalogue", type=Path, metavar="FILE")
    parser.add_argument("--out", type=Path, metavar="FILE")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(argv)
    try:
        scans = read_records(options.scans)
        catalogue = [] if options.catalogue is None else read_records(options.catalogue)
    except InputError as error:
        print(f"fit_confidence: {error}", file=sys.stderr)
        return 2
    console = Console(width=None if sys.stdout.isatty() else 150)
    tested = cross_validated(scans, catalogue, options.seed)
    console.print(table_of(tested))
    console.print(reliability_of(tested))
    if options.out is not None:
        fitted([*scans, *catalogue], _weights(scans, catalogue)).write(options.out)
        print(f"{options.out}: fitted to {len(scans)} estimates of scans, {len(catalogue)} others")
    return 0


if __name__ == "__main__":
    sys.exit(main())
