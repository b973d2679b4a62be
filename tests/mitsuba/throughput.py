#!/usr/bin/env python3
"""Paths per CPU-second of relt beside Mitsuba 3's path tracer, on the same scene, in the same run, on one thread.

    throughput.py [--relt PROGRAM] [--scene FILE] [--rounds N] [--variants llvm_ad_rgb,llvm_ad_rgb+robust,scalar_rgb]

Needs `pip install mitsuba numpy` (3.9.1 of the former). The variant llvm_ad_rgb compiles for this processor with LLVM: versions 14 and 15 do
not know the newest ones and fail; point DRJIT_LIBLLVM_PATH at the library of version 16 or later. On Debian 12:

    apt-get download libllvm19 && dpkg -x libllvm19_*.deb llvm
    export LD_LIBRARY_PATH=$PWD/llvm/usr/lib/x86_64-linux-gnu
    export DRJIT_LIBLLVM_PATH=$LD_LIBRARY_PATH/libLLVM.so.19.1

The scene is Bitterli's Cornell box at 512 × 512 pixels and at most 8 edges, roulette by both as they come (from the fifth
bounce on); RELT_SCENES is the folder that it lies in. Who goes first changes from round to round, and what is told is
the median over rounds of what each process spent of the processor, all its threads, system time included. Start-up
counts for nobody: relt's is the difference of two budgets, and Mitsuba has compiled its kernels before. A path of relt's
is a mutation: a whole path with next-event estimation, accepted or not, splatted on the film. Mitsuba leaves Embree's flag
ROBUST away, without which rays pass through edges; relt never does. "+robust" has Mitsuba set it too.
"""

import argparse
import os
import pathlib
import re
import resource
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).parent
SCENES = pathlib.Path(os.environ.get("RELT_SCENES", HERE.parents[2] / "shared/scenes"))
SIDE = 512
DEPTH = 8
BUDGETS = (4, 12)
METHODS = ("path", "mlt", "re")


def cpu(who):
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def of_relt(program, scene, method):
    """Mutations a CPU-second."""
    spent = []
    with tempfile.TemporaryDirectory() as folder:
        for budget in BUDGETS:
            before = cpu(resource.RUSAGE_CHILDREN)
            sizes = [f"-Dresx={SIDE}", f"-Dresy={SIDE}", f"-Dmax_depth={DEPTH}"]
            command = [program, "render", scene, *sizes, "--method", method, "--mapping", "unidirectional"]
            command += ["--threads", "1", "--mpp", str(budget), "-q", "-o", f"{folder}/image.exr"]
            subprocess.run(command, check=True)
            spent.append(cpu(resource.RUSAGE_CHILDREN) - before)
    return SIDE * SIDE * (BUDGETS[1] - BUDGETS[0]) / (spent[1] - spent[0])


def mitsuba_alone(variant, scene):
    """What a process of its own does: renders once to warm up, then once for each line that it is sent."""
    import drjit
    import mitsuba as mi
    import numpy as np

    variant, _, robust = variant.partition("+")
    mi.set_variant(variant)
    drjit.set_thread_count(1)
    text = pathlib.Path(scene).read_text()
    if robust:
        text = re.sub(r"<scene [^>]*>", r'\g<0><boolean name="embree_use_robust_intersections" value="true"/>', text)
    mi.file_resolver().append(str(pathlib.Path(scene).parent))
    scene = mi.load_string(text, resx=SIDE, resy=SIDE, max_depth=DEPTH)
    spp = BUDGETS[1] - BUDGETS[0]

    def render(seed):
        before = cpu(resource.RUSAGE_SELF)
        mean = np.array(mi.render(scene, spp=spp, seed=seed)).mean()
        return SIDE * SIDE * spp / (cpu(resource.RUSAGE_SELF) - before), mean

    render(0)
    print("ready", flush=True)
    for seed, _ in enumerate(sys.stdin, 1):
        print(*render(seed), flush=True)


class Mitsuba:
    def __init__(self, variant, scene):
        command = [sys.executable, __file__, "--alone", variant, "--scene", scene]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.works = self.process.stdout.readline() == "ready\n"

    def paths(self):
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline().split()[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--relt", default="relt")
    parser.add_argument("--scene", default=str(SCENES / "bitterli-cornell-box/scene.xml"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--variants", default="llvm_ad_rgb,llvm_ad_rgb+robust,scalar_rgb")
    parser.add_argument("--alone", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.alone:
        return mitsuba_alone(arguments.alone, arguments.scene)
    runs = {f"relt {method}": lambda method=method: of_relt(arguments.relt, arguments.scene, method) for method in METHODS}
    for variant in arguments.variants.split(","):
        mitsuba = Mitsuba(variant, arguments.scene)
        if mitsuba.works:
            runs[f"mitsuba {variant}"] = mitsuba.paths
        else:
            print(f"mitsuba {variant} does not run here", file=sys.stderr)
    found = {name: [] for name in runs}
    for number in range(arguments.rounds):
        order = list(runs)
        for name in order if number % 2 == 0 else reversed(order):
            found[name].append(runs[name]())
    rivals = [name for name in runs if name.startswith("mitsuba")]
    print(f"million paths a CPU-second, median of {arguments.rounds} rounds (least, most); by that of each rival")
    for name, values in found.items():
        median = statistics.median(values)
        by = ", ".join(f"{median / statistics.median(found[rival]):.2f} × {rival}" for rival in rivals)
        print(f"{name:29} {median / 1e6:.3f} ({min(values) / 1e6:.3f}, {max(values) / 1e6:.3f})  {by}")


if __name__ == "__main__":
    main()
