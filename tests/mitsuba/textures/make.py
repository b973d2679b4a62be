#!/usr/bin/env python3
"""Makes the pictures beside it, which scenes in the folder above use. Needs numpy, pillow and mitsuba (to write EXR)."""

import pathlib

import mitsuba as mi
import numpy as np
from PIL import Image

mi.set_variant("scalar_rgb")
HERE = pathlib.Path(__file__).parent


def exr(name, pixels):
    mi.Bitmap(pixels.astype(np.float32)).write(str(HERE / name))


def main():
    rows, columns = np.mgrid[0:8, 0:12]
    colours = np.stack([20 + 19 * columns, 250 - 30 * rows, 60 + 15 * ((rows * columns) % 12)], axis=2)
    Image.fromarray(colours.astype(np.uint8)).save(HERE / "colours.png")
    Image.fromarray((colours[:6, :6, 0] * 257).astype(np.uint16)).save(HERE / "grey16.png")
    Image.fromarray(np.kron(colours, np.ones((8, 8, 1))).astype(np.uint8)).save(HERE / "colours.jpg", quality=92)
    rows, columns = np.mgrid[0:16, 0:16]
    exr("heights.exr", np.repeat((0.5 + 0.5 * np.sin(columns * 0.8) * np.cos(rows * 0.5))[:, :, None], 3, axis=2))
    tilt = np.stack([np.sin(columns * 0.8) * 0.4, np.cos(rows * 0.6) * 0.4, np.ones((16, 16))], axis=2)
    exr("normals.exr", tilt / np.linalg.norm(tilt, axis=2, keepdims=True) * 0.5 + 0.5)
    Image.fromarray((((rows // 4 + columns // 4) % 2) * 155 + 50).astype(np.uint8)).save(HERE / "opacity.png")
    rows, columns = np.mgrid[0:16, 0:32]
    sky = 0.3 + 0.2 * np.sin(columns / 5)[:, :, None] * [1.0, 0.5, 0.2] + (rows / 16)[:, :, None] * [0.1, 0.2, 0.5]
    sky[5, 9] = [60, 50, 30]
    exr("sky.exr", sky)


if __name__ == "__main__":
    main()
