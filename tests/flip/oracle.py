#!/usr/bin/env python3
"""The authors' HDR-FLIP as an independent witness: what src/study/flip.rs is tested against.

Needs `pip install flip-evaluator` (1.7) outside the repository. `cargo test` needs none of this: it reads what

    python3 tests/flip/oracle.py > tests/flip/oracle.json

wrote. The pictures are made of whole numbers over powers of two, so that this file and the test have the same ones to
the last bit; `value` here and in the test say the same. The program refuses references of one brightness, so no case
has one.
"""

import json

import flip_evaluator
import numpy as np

# name, width, height, kind of the reference, kind of the image
CASES = [
    ("noise on a gradient", 48, 40, "gradient", "noisy gradient"),
    ("a lamp and its reflection", 64, 32, "lamp", "blurred lamp"),
    ("noise that is mostly dark", 56, 56, "sparse", "noisy gradient"),
    ("another hue", 20, 20, "gradient", "swapped gradient"),
    ("fewer pixels than a kernel", 7, 5, "gradient", "noisy gradient"),
    ("nothing", 16, 16, "gradient", "black"),
]


def noise(x, y, c):
    """0 to 255, hardly related between neighbours; all products stay below 2^53."""
    h = (x * 73 + y * 179 + c * 283 + 11) % 65521
    return (h * h * 31 + h * 17) % 65521 % 256


def picture(kind, width, height):
    values = np.zeros((height, width, 3))
    for y in range(height):
        for x in range(width):
            for c in range(3):
                values[y, x, c] = value(kind, x, y, c)
    return values.astype(np.float32)


def value(kind, x, y, c):
    gradient = (4 * x + 2 * y + 16 * c + 8) / 256
    lamp = 60 if 10 <= x < 14 and 8 <= y < 12 else (x % 8) / 64 + c / 32
    return {
        "gradient": gradient,
        "noisy gradient": gradient * (128 + noise(x, y, c)) / 256,
        "swapped gradient": (4 * x + 2 * y + 16 * (2 - c) + 8) / 256,
        "lamp": lamp,
        "blurred lamp": (lamp + 3 if 8 <= x < 16 and 6 <= y < 14 else lamp) / 2,
        "sparse": noise(x, y, c) / 4 if noise(y, x, 0) < 40 else 1 / 64,
        "black": 0,
    }[kind]


def case(name, width, height, reference, image):
    args = [picture(kind, width, height) for kind in (reference, image)]
    flip, mean, parameters = flip_evaluator.evaluate(*args, "HDR", applyMagma=False)
    flip = np.asarray(flip, dtype=np.float64).reshape(height, width, -1)[..., 0]
    return {
        "name": name,
        "width": width,
        "height": height,
        "reference": reference,
        "image": image,
        "start": parameters["startExposure"],
        "stop": parameters["stopExposure"],
        "number": parameters["numExposures"],
        "mean": mean,
        "map": [float(f"{v:.6f}") for v in flip.flatten()],
    }


cases = [case(*row) for row in CASES]
print("[" + ",\n".join(json.dumps(row, separators=(",", ":")) for row in cases) + "]")
