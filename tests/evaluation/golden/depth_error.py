#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Alignments and errors of made depths, and a z-buffer, by NumPy and SciPy.

    /usr/bin/python3 depth_error.py > depth_error.json

Least absolute values over scale and shift are a linear program here (HiGHS).
"""
import json
import sys

import numpy as np
import scipy
from scipy.optimize import linprog


def fraction(count, ratio):
    index = np.arange(1, count + 1) * ratio
    return index - np.floor(index)


def made_depths(count):
    """Expected, and predicted as a crooked line of it with noise; every 10th is far off."""
    expected = 1.0 + 4.0 * fraction(count, 0.8191725134)
    predicted = 0.5 * expected + 0.4 + 0.2 * (fraction(count, 0.6710436067) - 0.5)
    return np.where(np.arange(count) % 10 == 9, 3.0 * predicted, predicted), expected


def weiszfeld(predicted, expected):
    scale = expected.mean() / predicted.mean()
    for _ in range(10):
        weight = 1 / (np.abs(scale * predicted - expected) + 1e-8 * expected.mean())
        scale = np.sum(weight * predicted * expected) / np.sum(weight * predicted**2)
    return scale


def least_absolute(predicted, expected):
    n = len(predicted)
    line = np.stack([predicted, np.ones(n)], axis=1)
    solution = linprog(np.concatenate([[0, 0], np.ones(n)]),
                       A_ub=np.block([[line, -np.eye(n)], [-line, -np.eye(n)]]),
                       b_ub=np.concatenate([expected, -expected]),
                       bounds=[(None, None)] * 2 + [(0, None)] * n, method="highs")
    return solution.x[:2]


def errors(predicted, expected, scale, shift=0.0):
    aligned = scale * predicted + shift
    ratio = np.maximum(aligned / expected, expected / aligned)
    return {"scale": scale, "shift": shift, "abs_rel": np.mean(np.abs(aligned - expected) / expected),
            "within_percent": 100 * np.mean((ratio < 1.25) & (aligned > 0))}


def z_buffer():
    """2000 points of a slanted plane and a floating patch in a camera of 12 x 9 pixels, by rows."""
    x = 6 * fraction(2000, 0.8191725134) - 3
    y = 6 * fraction(2000, 0.6710436067) - 3
    z = np.where(np.arange(2000) % 4 == 3, 2.0 + 0.1 * x, 4.0 + 0.3 * y)
    angle = 0.2
    rotation = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    cam = np.stack([x, y, z], axis=1) @ rotation.T + np.array([0.1, -0.2, 0.3])
    cam = cam[cam[:, 2] > 0]
    column = np.floor(10 * cam[:, 0] / cam[:, 2] + 6).astype(int)
    row = np.floor(11 * cam[:, 1] / cam[:, 2] + 4.5).astype(int)
    depth = np.full((9, 12), np.inf)
    inside = (column >= 0) & (column < 12) & (row >= 0) & (row < 9)
    np.minimum.at(depth, (row[inside], column[inside]), cam[inside, 2])
    return [None if np.isinf(value) else value for value in depth.ravel()]


def main():
    predicted, expected = made_depths(300)
    json.dump({
        "made_by": f"numpy {np.__version__}, scipy {scipy.__version__}",
        "none": errors(predicted, expected, 1.0),
        "median": errors(predicted, expected, np.median(expected) / np.median(predicted)),
        "scale": errors(predicted, expected, weiszfeld(predicted, expected)),
        "scale_shift": errors(predicted, expected, *least_absolute(predicted, expected)),
        "z_buffer": z_buffer(),
    }, sys.stdout, indent=1)


main()
