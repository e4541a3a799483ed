#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Errors of views and pairs, RRA, RTA and both AUCs by NumPy and SciPy, of evo_trajectories.json.

    /usr/bin/python3 pair_accuracy.py < evo_trajectories.json > pair_accuracy.json
"""
import itertools
import json
import sys

import numpy as np
import scipy
from scipy.spatial.transform import Rotation


def split(rows):
    rows = np.array(rows)
    return rows[:, :3], Rotation.from_quat(rows[:, 3:])


def view_errors(estimate, reference):
    """After the best similarity of the centres: rotation by SciPy, then scale in closed form."""
    centres, turns = split(estimate)
    true_centres, true_turns = split(reference)
    a = centres - centres.mean(axis=0)
    b = true_centres - true_centres.mean(axis=0)
    rotation, _ = Rotation.align_vectors(b, a)
    scale = np.sum(b * rotation.apply(a)) / np.sum(a * a)
    centre_errors = np.linalg.norm(scale * rotation.apply(a) - b, axis=1)
    rotation_errors = np.rad2deg((true_turns.inv() * rotation * turns).magnitude())
    return {"scale": scale, "centre": centre_errors.tolist(), "rotation_deg": rotation_errors.tolist()}


def angle_deg(a, b):
    """Of directions; Kahan's formula, exact for small and for large angles."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    return np.rad2deg(2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b)))


def pair_errors(estimate, reference):
    centres, turns = split(estimate)
    true_centres, true_turns = split(reference)
    rotations, directions = [], []
    for i, j in itertools.combinations(range(len(centres)), 2):
        relative = turns[i].inv() * turns[j]
        true_relative = true_turns[i].inv() * true_turns[j]
        rotations.append(np.rad2deg((true_relative.inv() * relative).magnitude()))
        directions.append(
            angle_deg(
                turns[i].inv().apply(centres[j] - centres[i]),
                true_turns[i].inv().apply(true_centres[j] - true_centres[i]),
            )
        )
    return np.array(rotations), np.array(directions)


def auc_histogram(errors, threshold):
    counts, _ = np.histogram(errors, bins=np.arange(threshold + 1))
    return float(np.mean(np.cumsum(counts / len(errors))))


def auc_trapezoid(errors, threshold):
    errors = np.concatenate([[0.0], np.sort(errors)])
    recall = np.arange(len(errors)) / (len(errors) - 1)
    inside = errors <= threshold
    x = np.concatenate([errors[inside], [threshold]])
    y = np.concatenate([recall[inside], [recall[inside][-1]]])
    return float(np.trapz(y, x) / threshold)


def accuracy(rotations, directions, threshold):
    folded = np.minimum(directions, 180.0 - directions)
    return {
        "threshold_deg": threshold,
        "rra": float(np.mean(rotations < threshold)),
        "rta": float(np.mean(folded < threshold)),
        "auc_histogram": auc_histogram(np.maximum(rotations, folded), threshold),
        "auc_trapezoid": auc_trapezoid(np.maximum(rotations, directions), threshold),
    }


def main():
    cases = {}
    for name, case in json.load(sys.stdin)["cases"].items():
        rotations, directions = pair_errors(case["estimate"], case["reference"])
        cases[name] = {
            "views": view_errors(case["estimate"], case["reference"]),
            "rotation_deg": rotations.tolist(),
            "direction_deg": directions.tolist(),
            "accuracy": [accuracy(rotations, directions, t) for t in (1, 3, 5, 10, 30)],
        }
    random = np.random.RandomState(7)
    exponential = random.exponential(scale=2.0, size=500)
    curves = {"errors_deg": exponential.tolist(), "auc": []}
    for threshold in (1, 3, 5, 10, 30):
        curves["auc"].append(
            {
                "threshold_deg": threshold,
                "histogram": auc_histogram(exponential, threshold),
                "trapezoid": auc_trapezoid(exponential, threshold),
            }
        )
    made_by = {
        "script": "tests/evaluation/golden/pair_accuracy.py",
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }
    json.dump({"made_by": made_by, "cases": cases, "exponential": curves}, sys.stdout, indent=0)
    print()


if __name__ == "__main__":
    main()
