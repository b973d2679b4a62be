#!/usr/bin/env python3
"""Where a mutation goes, in counts that hold on a busy machine too.

    counts.py instructions [PROGRAM...]   instructions a mutation, in relt's own code and in Embree (valgrind)
    counts.py shares [PROGRAM...]         share of the samples of a profile in relt's own code and in Embree (perf)

Programs are builds of relt, `target/release/relt` without any; several are told side by side, such as one before a change
and one after it. `--mapping NAME`, `--scene NAME` and `--method NAME` (the latter two as often as you like) choose what runs: the
unidirectional mapping, all scenes and all methods without them. One thread.

Instructions are the difference of two budgets, so start-up, the reading of the scene and Embree's build count for
nothing; with the same program they are the same from run to run but for what depends on time: a few in a thousand.
Valgrind's processor has AVX2 and no AVX-512. Packets are of 8 rays, as measuring their width would depend on time.

Shares are of one short run each, start-up included, so what is told of relt's own code is too much rather than too little.
"""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENES = ("cornell-box", "caustic", "lattice")
METHODS = ("path", "mlt", "re")
SIDE = 64
# Replica exchange of few mutations is all learning; ladders are given, and the same for both budgets.
BUDGETS = {"path": (4, 12), "mlt": (4, 12), "re": (16, 32)}
LADDER = ["--replicas", "4", "--uniform-share", "0.5"]
MPP = 24


def render(program, mapping, scene, method, image, *options):
    ladder = LADDER if method == "re" else []
    return [
        program, "render", str(ROOT / "scenes" / scene / "scene.xml"), "--method", method, "--mapping", mapping,
        "--threads", "1", "-q", "-o", image, *ladder, *options,
    ]  # fmt: skip


def quietly(command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stderr}")
    return done.stdout


def of_objects(lines, program):
    """Sums of numbers beside names of objects: relt's own, Embree's and those of others."""
    own, embree, other = 0, 0, 0
    for number, name in lines:
        if pathlib.Path(name).name == pathlib.Path(program).name:
            own += number
        elif "embree" in name:
            embree += number
        else:
            other += number
    return own, embree, other


def instructions(program, mapping, scene, method, folder):
    sums = []
    for budget in BUDGETS[method]:
        out = f"{folder}/counts"
        tool = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}"]
        options = [f"-Dres={SIDE}", "--packet", "8", "--mpp", str(budget)]
        quietly([*tool, *render(program, mapping, scene, method, f"{folder}/image.exr", *options)])
        sums.append(of_objects(by_object(out), program))
    mutations = SIDE * SIDE * (BUDGETS[method][1] - BUDGETS[method][0])
    return [(more - fewer) / mutations for fewer, more in zip(*sums)]


def by_object(path):
    """Instructions by object file, from callgrind's output: lines of cost under the `ob=` in force, but for those of calls,
    which tell what is counted where it was called."""
    names, counts, current, skip = {}, {}, "", False
    for line in open(path):
        found = re.match(r"ob=\((\d+)\)(?: (.*))?", line)
        if found:
            current = names.setdefault(found[1], found[2])
        elif line.startswith("cob="):
            found = re.match(r"cob=\((\d+)\)(?: (.*))?", line)
            if found[2]:
                names.setdefault(found[1], found[2])
        elif line.startswith("calls="):
            skip = True
        elif line[0].isdigit() or line[0] in "+-*":
            if not skip:
                counts[current] = counts.get(current, 0) + int(line.split()[1])
            skip = False
    return [(count, name or "") for name, count in counts.items()]


def shares(program, mapping, scene, method, folder):
    data = f"{folder}/profile"
    command = render(program, mapping, scene, method, f"{folder}/image.exr", "--mpp", str(MPP))
    quietly(["perf", "record", "-e", "cpu-clock", "-F", "1000", "-o", data, *command])
    text = quietly(["perf", "report", "-i", data, "--no-children", "--sort", "dso", "--stdio"])
    found = re.findall(r"^\s*([\d.]+)%\s+(\S+)", text, re.MULTILINE)
    return of_objects([(float(share), name) for share, name in found], program)


def main():
    tools = {"instructions": instructions, "shares": shares}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tool", choices=tools)
    parser.add_argument("programs", nargs="*", default=[str(ROOT / "target/release/relt")])
    parser.add_argument("--mapping", default="unidirectional")
    parser.add_argument("--scene", action="append", choices=SCENES)
    parser.add_argument("--method", action="append", choices=METHODS)
    asked = parser.parse_intermixed_args()
    programs = asked.programs
    print("| scene | method |" + "".join(f" {program}: relt, Embree, others; Embree / all |" for program in programs))
    print("|---|---|" + "---|" * len(programs))
    with tempfile.TemporaryDirectory() as folder:
        for scene in asked.scene or SCENES:
            for method in asked.method or METHODS:
                cells = []
                for program in programs:
                    own, embree, other = tools[asked.tool](program, asked.mapping, scene, method, folder)
                    cells.append(f"{own:.0f}, {embree:.0f}, {other:.0f}; {embree / (own + embree + other):.2f}")
                print(f"| `{scene}` | `{method}` | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
