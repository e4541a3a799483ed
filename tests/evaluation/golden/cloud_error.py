#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Distances, normals, voxels and ICP of made clouds by NumPy and SciPy's cKDTree.

    /usr/bin/python3 cloud_error.py > cloud_error.json

cloud_error_test.cc makes the same clouds bit by bit: made_cloud() uses +, -, * and floor only.
"""
import json
import sys

import numpy as np
import scipy
from scipy.spatial import cKDTree


def made_cloud(count, shift, roughness):
    """A rough saddle under 6 x 6 units with a cube of outliers in place of every 50th point."""
    index = np.arange(1, count + 1) + float(shift)
    u, v, w = (index * ratio - np.floor(index * ratio) for ratio in (0.8191725134, 0.6710436067, 0.5497004779))
    x = 6.0 * u - 3.0
    y = 6.0 * v - 3.0
    z = 0.1 * x * x - 0.2 * x * y + roughness * (w - 0.5)
    is_outlier = np.arange(count) % 50 == 49
    return np.stack([x, y, np.where(is_outlier, 3.0 * w, z)], axis=1)


def normals(points, count=30):
    _, neighbours = cKDTree(points).query(points, count)
    patches = points[neighbours]
    offsets = patches - patches.mean(axis=1, keepdims=True)
    _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))
    return vectors[:, :, 0]


def directed(points, targets, clip, within):
    distance, nearest = cKDTree(targets).query(points)
    cosine = np.abs(np.sum(normals(points) * normals(targets)[nearest], axis=1))
    clipped = np.minimum(distance, clip)
    return {
        "mean": clipped.mean(), "median": np.median(clipped), "share": np.mean(distance < within),
        "normal_mean": cosine.mean(), "normal_median": np.median(cosine), "num_clipped": int(np.sum(distance > clip)),
    }


def compare(prediction, reference, clip=np.inf, within=0.05):
    accuracy = directed(prediction, reference, clip, within)
    completeness = directed(reference, prediction, clip, within)
    p, r = accuracy["share"], completeness["share"]
    return {
        "accuracy": accuracy, "completeness": completeness, "f": 2 * p * r / (p + r),
        "overall": (accuracy["mean"] + completeness["mean"]) / 2,
        "normal_mean": (accuracy["normal_mean"] + completeness["normal_mean"]) / 2,
        "normal_median": (accuracy["normal_median"] + completeness["normal_median"]) / 2,
    }


def voxel_means(points, edge):
    cubes, cube_of_point = np.unique(np.floor(points / edge).astype(int), axis=0, return_inverse=True)
    means = np.zeros((len(cubes), 3))
    np.add.at(means, cube_of_point, points)
    return means / np.bincount(cube_of_point)[:, None]


def turn(degrees):
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def umeyama(a, b, with_scale):
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    u, d, vt = np.linalg.svd((b - mean_b).T @ (a - mean_a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = u @ sign @ vt
    scale = np.trace(np.diag(d) @ sign) / np.sum((a - mean_a) ** 2) if with_scale else 1.0
    return scale, rotation, mean_b - scale * rotation @ mean_a


def icp(source, target, max_distance, with_scale, max_iterations=30, min_change=1e-6):
    """Point to point; with scale by pairs of both directions, in the target's frame."""
    motion = (1.0, np.eye(3), np.zeros(3))

    def pairs():
        moved = motion[0] * source @ motion[1].T + motion[2]
        distance, nearest = cKDTree(target).query(moved)
        keep = distance <= max_distance
        a, b, found = source[keep], target[nearest[keep]], distance[keep]
        asked = len(source)
        if with_scale:
            distance, nearest = cKDTree(moved).query(target)
            keep = distance <= max_distance
            a, b = np.vstack([a, source[nearest[keep]]]), np.vstack([b, target[keep]])
            found = np.concatenate([found, distance[keep]])
            asked += len(target)
        return a, b, len(found) / asked, np.sqrt(np.mean(found**2))

    a, b, share, rmse = pairs()
    for iteration in range(1, max_iterations + 1):
        motion = umeyama(a, b, with_scale)
        before = share, rmse
        a, b, share, rmse = pairs()
        if abs(share - before[0]) < min_change and abs(rmse - before[1]) < min_change:
            break
    return {"scale": motion[0], "rotation": motion[1].tolist(), "translation": motion[2].tolist(),
            "share": share, "rmse": rmse, "iterations": iteration}


def main():
    prediction = made_cloud(3000, 0.25, 0.06)
    reference = made_cloud(4000, 7.75, 0.02)
    reference = reference[reference[:, 0] > -2.5]  # something that only the prediction has
    voxels = voxel_means(prediction, 0.3), voxel_means(reference, 0.3)
    moved = (0.98 * reference[::2]) @ turn(1.5).T + np.array([0.03, -0.02, 0.05])
    json.dump({
        "made_by": f"numpy {np.__version__}, scipy {scipy.__version__}",
        "plain": compare(prediction, reference),
        "clipped": compare(prediction, reference, clip=0.2, within=0.1),
        "voxels": {"num_prediction": len(voxels[0]), "num_reference": len(voxels[1]), **compare(*voxels, within=0.1)},
        "moved_points": moved[:3].tolist(),
        "icp": icp(moved, reference, 0.2, with_scale=False),
        "icp_with_scale": icp(moved, reference, 0.2, with_scale=True),
    }, sys.stdout, indent=1)


main()
