#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories made here, and ATE and RPE that evo (github.com/MichaelGrupp/evo) finds for them.

    PYTHONPATH=<a checkout of evo> /usr/bin/python3 evo_trajectories.py <its commit> > evo_trajectories.json

Needs numpy and scipy only (Debian: python3-numpy, python3-scipy). evo is no part of this repository.
"""
import copy
import json
import sys

import numpy as np
import scipy
from evo.core import metrics
from evo.core.trajectory import PosePath3D
from scipy.spatial.transform import Rotation


def make_case(seed, num_poses, noise, rotation_noise_deg, scale):
    """world_from_cam of both as rows (tx ty tz qx qy qz qw): a bent loop, and a noisy similar one."""
    random = np.random.RandomState(seed)
    angle = np.linspace(0.0, 1.7 * np.pi, num_poses)
    centres = np.stack([3 * np.cos(angle), 2 * np.sin(angle), 0.5 * np.sin(3 * angle)], axis=1)
    turns = Rotation.from_euler("zyx", np.stack([angle, 0.3 * np.sin(2 * angle), 0.2 * angle], axis=1))
    world_rotation = Rotation.from_rotvec(random.normal(size=3))
    estimated = scale * world_rotation.apply(centres + random.normal(scale=noise, size=centres.shape))
    estimated += random.normal(scale=5.0, size=3)
    wobble = Rotation.from_rotvec(random.normal(scale=np.deg2rad(rotation_noise_deg), size=(num_poses, 3)))
    return {
        "reference": np.concatenate([centres, turns.as_quat()], axis=1),
        "estimate": np.concatenate([estimated, (world_rotation * turns * wobble).as_quat()], axis=1),
    }


def path_of(rows):
    return PosePath3D(positions_xyz=rows[:, :3], orientations_quat_wxyz=rows[:, [6, 3, 4, 5]])


def statistics_of(metric):
    statistics = metric.get_all_statistics()
    return {key: float(statistics[key]) for key in ("rmse", "mean", "median", "max")}


def evaluate(case, alignment):
    reference = path_of(case["reference"])
    estimate = copy.deepcopy(path_of(case["estimate"]))
    if alignment == "first":
        estimate.align_origin(reference)
    elif alignment != "none":
        estimate.align(reference, correct_scale=alignment == "sim3")
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((reference, estimate))
    result = {"ate": statistics_of(ape), "rpe": []}
    for delta in (1, 3):
        for all_pairs in (True, False):
            entry = {"delta": delta, "all_pairs": all_pairs}
            for key, relation in (
                ("translation", metrics.PoseRelation.translation_part),
                ("rotation_deg", metrics.PoseRelation.rotation_angle_deg),
            ):
                rpe = metrics.RPE(relation, delta=delta, all_pairs=all_pairs)
                rpe.process_data((reference, estimate))
                entry[key] = statistics_of(rpe)
                entry["num_pairs"] = len(rpe.error)
            result["rpe"].append(entry)
    return result


def main():
    cases = {
        "loop": make_case(seed=1, num_poses=24, noise=0.03, rotation_noise_deg=1.0, scale=2.5),
        "rough": make_case(seed=2, num_poses=11, noise=0.6, rotation_noise_deg=25.0, scale=0.2),
        "four_views": make_case(seed=3, num_poses=4, noise=1e-4, rotation_noise_deg=0.01, scale=1.0),
    }
    for case in cases.values():
        case["evo"] = {name: evaluate(case, name) for name in ("none", "first", "se3", "sim3")}
        case["reference"] = case["reference"].tolist()
        case["estimate"] = case["estimate"].tolist()
    made_by = {
        "script": "tests/evaluation/golden/evo_trajectories.py",
        "evo_commit": sys.argv[1],
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }
    json.dump({"made_by": made_by, "cases": cases}, sys.stdout, indent=0)
    print()


if __name__ == "__main__":
    main()
