#!/usr/bin/env python3
"""How throughput and memory grow with triangles, depth, image and ladder.

    growth.py [--relt PROGRAM] [--rounds N] [triangles] [depth] [size] [rungs] [memory]

The scene is made here: a room with a light in its ceiling and a hilly floor of as many triangles as wanted. Mutations a
CPU-second (on one thread, with the unidirectional mapping) are the difference of two budgets, so start-up, the reading of
the scene, Embree's build and the picture at the end count for nothing; numbers are medians over rounds, in which
everything has its turn. Ladders are given, with half uniform points, and so learn for a while in both budgets. Memory is
the most that was ever resident, of whole runs.
"""

import argparse
import array
import json
import math
import os
import pathlib
import statistics
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
METHODS = ("path", "mlt", "re")
# Mutations of the two budgets, in millions.
BUDGETS = {"path": (0.5, 2.5), "mlt": (0.5, 2.5), "re": (1, 4)}
TRIANGLES = (100, 10_000, 1_000_000)
DEPTHS = (2, 4, 8, 16, 32, 64)
SIDES = (256, 512, 1024, 2048, 4096)
RUNGS = (2, 4, 8, 16, 32, 64)
SIZE, DEPTH, HILLS = 256, 8, 10_000
FOUR_K = (3840, 2160)

SCENE = """<scene version='3.0.0'>
  <default name='width' value='{size}'/><default name='height' value='{size}'/><default name='max_depth' value='{depth}'/>
  <integrator type='path'><integer name='max_depth' value='$max_depth'/></integrator>
  <sensor type='perspective'>
    <string name='fov_axis' value='smaller'/><float name='fov' value='60'/>
    <transform name='to_world'><lookat origin='0, 0.2, 0.98' target='0, -0.2, 0' up='0, 1, 0'/></transform>
    <film type='hdrfilm'>
      <integer name='width' value='$width'/><integer name='height' value='$height'/><rfilter type='box'/>
    </film>
  </sensor>
  <bsdf type='twosided' id='wall'><bsdf type='diffuse'><rgb name='reflectance' value='0.7, 0.6, 0.5'/></bsdf></bsdf>
  <shape type='cube'><ref id='wall'/></shape>
  <shape type='ply'><string name='filename' value='hills.ply'/><ref id='wall'/></shape>
  <shape type='rectangle'>
    <transform name='to_world'>
      <scale value='0.2'/><rotate x='1' angle='90'/><translate y='0.99'/>
    </transform>
    <ref id='wall'/><emitter type='area'><rgb name='radiance' value='20, 18, 15'/></emitter>
  </shape>
</scene>
"""


def write_scene(folder, triangles):
    """A room whose hills have about so many triangles."""
    n = max(1, round(math.sqrt(triangles / 2)))
    points, corners = array.array("f"), array.array("i")
    for i in range(n + 1):
        for j in range(n + 1):
            x, z = 2 * i / n - 1, 2 * j / n - 1
            height = 0.2 * math.sin(7 * x + 1) * math.cos(5 * z) + 0.03 * math.sin(43 * x) * math.sin(37 * z)
            points.extend((0.999 * x, height - 0.6, 0.999 * z))
    faces = bytearray()
    for i in range(n):
        for j in range(n):
            a, b, c, d = (k * (n + 1) + m for k, m in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
            for face in ((a, c, b), (a, d, c)):
                faces += b"\x03" + array.array("i", face).tobytes()
    head = f"""ply
format binary_little_endian 1.0
element vertex {(n + 1) ** 2}
property float x
property float y
property float z
element face {2 * n * n}
property list uchar int vertex_indices
end_header
"""
    folder.mkdir()
    (folder / "hills.ply").write_bytes(head.encode() + points.tobytes() + faces)
    scene = folder / "scene.xml"
    scene.write_text(SCENE.format(size=SIZE, depth=DEPTH))
    return str(scene)


class Run:
    """A kind of run, by the two budgets whose difference counts."""

    def __init__(self, program, scene, method, *options, size=(SIZE, SIZE)):
        self.command = [program, "render", scene, "--method", method, "--mapping", "unidirectional", "--threads", "1", "-q"]
        self.command += [f"-Dwidth={size[0]}", f"-Dheight={size[1]}", *options]
        if method == "re" and "--replicas" not in options:
            self.command += ["--replicas", "4"]
        if method == "re":
            self.command += ["--uniform-share", "0.5"]
        self.pixels, self.found = size[0] * size[1], []
        # memory of the film is first touched, and the picture is written, in both; that takes seconds on large films, so the
        # difference is larger there
        few, many = BUDGETS[method]
        start = few + self.pixels / 1e6
        self.budgets = (start, start + (many - few) * max(1, self.pixels / 2**22))

    def spent(self, millions):
        """CPU-seconds, mutations, rays and the most memory of a run."""
        with tempfile.TemporaryDirectory() as folder:
            command = [*self.command, "--mpp", repr(millions * 1e6 / self.pixels), "-o", f"{folder}/image.exr"]
            process = subprocess.Popen([*command, "--log", f"{folder}/log"])
            _, status, used = os.wait4(process.pid, 0)
            if status:
                raise SystemExit(f"{' '.join(command)} failed")
            end = json.loads(pathlib.Path(folder, "log").read_text().splitlines()[-1])
        return used.ru_utime + used.ru_stime, end["mutations"], end["rays"], used.ru_maxrss * 1024

    def turn(self):
        few, many = (self.spent(budget) for budget in self.budgets)
        seconds, mutations, rays = (b - a for a, b in zip(few[:3], many[:3]))
        self.found.append((mutations / seconds / 1e6, rays / seconds / 1e6, rays / mutations))

    def cell(self):
        mutations, rays, each = (statistics.median(values) for values in zip(*self.found))
        return f"{mutations:.3f}, {rays:.1f} ({each:.1f})"


def table(title, rows, columns, rounds):
    """Rows by columns of runs, after each has had its turns."""
    for _ in range(rounds):
        for runs in rows.values():
            for run in runs:
                run.turn()
    print(f"{title}: million mutations and million rays a CPU-second (rays a mutation)\n")
    print(f"| | {' | '.join(f'`{column}`' for column in columns)} |")
    print("|---|" + "---|" * len(columns))
    for name, runs in rows.items():
        print(f"| {name} | {' | '.join(run.cell() for run in runs)} |")
    print(flush=True)


def memory(program, scene):
    print(f"The most memory of runs of {FOUR_K[0]} × {FOUR_K[1]} pixels\n\n| run | |\n|---|---|")
    runs = [("path",), ("mlt",), *(("re", "--replicas", str(k)) for k in (2, 8, 32)), ("re", "--replicas", "8", "--layers")]
    for method, *options in runs:
        *_, most = Run(program, scene, method, *options, size=FOUR_K).spent(4)
        print(f"| `{' '.join((method, *options))}` | {most / 1e9:.2f} GB |", flush=True)
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--relt", default=str(ROOT / "target/release/relt"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("what", nargs="*", help="triangles, depth, size, rungs, memory; all without any")
    arguments = parser.parse_args()
    program, rounds = arguments.relt, arguments.rounds
    wanted = arguments.what or ["triangles", "depth", "size", "rungs", "memory"]
    with tempfile.TemporaryDirectory() as folder:
        counts = TRIANGLES if "triangles" in wanted else (HILLS,)
        scenes = {count: write_scene(pathlib.Path(folder, str(count)), count) for count in counts}
        hills = scenes[HILLS]

        def of_methods(scene, *options, **others):
            return [Run(program, scene, method, *options, **others) for method in METHODS]

        if "triangles" in wanted:
            table("Triangles", {count: of_methods(scene) for count, scene in scenes.items()}, METHODS, rounds)
        if "depth" in wanted:
            table("Longest path", {d: of_methods(hills, f"-Dmax_depth={d}") for d in DEPTHS}, METHODS, rounds)
        if "size" in wanted:
            table("Image", {f"{s}²": of_methods(hills, size=(s, s)) for s in SIDES}, METHODS, rounds)
        if "rungs" in wanted:
            rows = {k: [Run(program, hills, "re", "--replicas", str(k))] for k in RUNGS}
            table("Rungs", rows, ("re",), rounds)
        if "memory" in wanted:
            memory(program, hills)


if __name__ == "__main__":
    main()
