#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""network_peer.py PARITY_DIR WEIGHTS.safetensors NUM_VIEWS HEIGHT WIDTH
VGGT in Python, as oracle.py of the parity fixtures has it, on random images with the same weights as
network_benchmark; prints the same figures. Needs python3-torch and numpy."""
import json
import os
import resource
import struct
import sys
import time

parity_dir, weights_path = sys.argv[1:3]
num_views, height, width = map(int, sys.argv[3:6])
sys.argv = [sys.argv[0], parity_dir]
sys.path.insert(0, parity_dir)
import torch  # noqa: E402
import oracle  # noqa: E402

torch.set_num_threads(os.cpu_count())


def read_weights(path):
    with open(path, "rb") as file:
        (length,) = struct.unpack("<Q", file.read(8))
        header = json.loads(file.read(length))
        header.pop("__metadata__", None)
        weights = {}
        for name, entry in header.items():
            begin, end = entry["data_offsets"]
            file.seek(8 + length + begin)
            data = torch.frombuffer(bytearray(file.read(end - begin)), dtype=torch.float32)
            weights[name] = data.reshape(entry["shape"])
    return weights


start = time.time()
weights = read_weights(weights_path)
config = dict(num_heads=16, camera_heads=16, dino_depth=24, depth=24, layers=[4, 11, 17, 23],
              patch_embed="dinov2")
images = torch.rand(num_views, 3, height, width)
with torch.no_grad():
    loaded = time.time()
    tokens = oracle.aggregator(images, weights, config, None)
    encoded = time.time()
    oracle.camera(tokens[-1], weights, config["camera_heads"])
    cameras = time.time()
    for head in ("depth_head", "point_head"):
        # In chunks of 8 views, as the official code does.
        for begin in range(0, num_views, 8):
            chunk = [layer[begin:begin + 8] for layer in tokens]
            oracle.dpt(chunk, config["layers"], weights, head, height, width)
    heads = time.time()
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20)
print(json.dumps({"load_sec": round(loaded - start, 2), "encode_sec": round(encoded - loaded, 2),
                  "cameras_sec": round(cameras - encoded, 2), "heads_sec": round(heads - cameras, 2),
                  "forward_sec": round(heads - loaded, 2), "peak_gib": round(peak, 2)}))
