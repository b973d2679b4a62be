#!/usr/bin/env python3
"""How a run scales, from what it costs: fits a small model to runs on this machine, checks it against others, and predicts
what cannot be run here. See docs/scaling.md.

    cargo build --release && tests/engines/scaling.py [RELT [RELT_WITH_MPI]] [--network LATENCY,BANDWIDTH]

Costs are processor times, which other programs hardly change, and sizes and numbers of messages, which are exact; so the machine
need not be quiet. Where a relt has `--features mpi` and there is mpirun, what ranks tell one another is measured too. The network
that is predicted for has a latency in seconds and a bandwidth in bytes a second [default: 2e-6,10e9].
"""

import json
import math
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENE = str(ROOT / "scenes/lattice/scene.xml")
BASE = ["-D", "res=64", "--mapping", "unidirectional", "--seed", "5"]
BLOCKS = 64  # a job is cut into as many at most (src/chain/plan.rs)


def run(relt, folder, *options, before=()):
    """Runs; what the log's last line says, and what was said of ranks."""
    log = folder / "run.jsonl"
    log.unlink(missing_ok=True)
    command = [*before, relt, "render", SCENE, *BASE, *options, "-o", "run.exr", "--log", "run.jsonl"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}: {done.stderr}")
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    end = lines[-1]
    end["rounds"] = sum(line["event"] == "round" for line in lines)
    found = re.search(r"in (\d+) exchanges of ([\d.]+) MB", done.stderr)
    end["exchanges"], end["megabytes"] = (int(found[1]), float(found[2])) if found else (0, 0.0)
    return end


def line(xs, ys):
    """Least squares: intercept and slope."""
    n, sx, sy = len(xs), sum(xs), sum(ys)
    slope = (n * sum(x * y for x, y in zip(xs, ys)) - sx * sy) / (n * sum(x * x for x in xs) - sx * sx)
    return (sy - slope * sx) / n, slope


def compared(rows):
    print("| run | measured | model | model / measured |\n|---|---|---|---|")
    for name, measured, model in rows:
        print(f"| {name} | {measured:.3g} | {model:.3g} | {model / measured:.2f} |")
    print()


def talk_of_ranks(relt, folder):
    """Fits and checks what ranks tell one another: t₀, t₁ and the number of rounds; nothing where there is no MPI."""
    probe = ["mpirun", "--allow-run-as-root", "--oversubscribe", "--bind-to", "none", "-n"]
    # without the feature, mpirun starts the same run several times
    probing = [*probe, "2", relt, "render", SCENE, *BASE, "--mpp", "1", "--threads", "1", "-o", "probe.exr"]
    if not shutil.which("mpirun") or "on 2 ranks" not in subprocess.run(probing, cwd=folder, capture_output=True, text=True).stderr:
        return None

    def ranks(n, k):
        return run(relt, folder, "--threads", "1", "--mpp", "60", "--replicas", str(k), before=[*probe, str(n)])

    # of all blocks, those elsewhere tell t₀ + t₁ K a round; film and probes are in t₀
    print("Bytes that rank 0 hears: (1 − 1/n) · rounds · (t₀ + t₁ K)\n")
    first, second = ranks(2, 4), ranks(2, 16)
    share = lambda end, n: end["megabytes"] / (end["rounds"] + 1) / (1 - 1 / n)
    t0, t1 = line([4, 16], [share(first, 2), share(second, 2)])
    rows = []
    for n, k in ((3, 4), (4, 4), (2, 8), (2, 32), (5, 16)):
        end = ranks(n, k)
        rows.append((f"{n} ranks, K = {k} (MB)", end["megabytes"], (1 - 1 / n) * (end["rounds"] + 1) * (t0 + t1 * k)))
    compared(rows)
    print(f"t₀ + t₁ K = {t0:.2f} + {t1:.3f} K MB a round, {first['exchanges']} exchanges in all\n")
    return t0, t1, first["rounds"]


def predict(start, each, told, latency, bandwidth):
    """Prints what a large run is to take: `start` and `each` in seconds a run and a mutation, `told` of `talk_of_ranks`."""
    print("Predicted for a network of %g µs and %g GB/s, a picture of 10¹⁰ mutations with K = 4:\n" % (1e6 * latency, bandwidth / 1e9))
    print("| cores | as | compute (s) | start (s) | talk (s) | efficiency |\n|---|---|---|---|---|---|")
    work = 1e10 * each
    for cores in (1, 16, 64, 1000):
        for parts in sorted({1, math.ceil(cores / BLOCKS), cores}):
            ranks = math.ceil(cores / parts)
            if ranks > BLOCKS or (ranks > 1 and told is None):
                continue
            blocks = math.ceil(BLOCKS / ranks) / BLOCKS * ranks  # the rank with the most blocks is waited for
            compute = work / cores * blocks
            talk = 0.0
            if ranks > 1:
                rounds = told[2] + math.log2(max(compute * cores / parts / (start + 1), 1))
                talk = rounds * (math.ceil(math.log2(ranks)) * latency + 1e6 * (told[0] + 4 * told[1]) / bandwidth)
                talk += compute / 0.2 * 2 * math.ceil(math.log2(ranks)) * latency  # an order a slice
            print(f"| {cores} | {parts} parts × {ranks} ranks | {compute:.1f} | {start:.2f} | {talk:.3f} | {work / cores / (compute + start + talk):.2f} |")


def main():
    words = sys.argv[1:]
    latency, bandwidth = 2e-6, 10e9
    if "--network" in words:
        at = words.index("--network")
        latency, bandwidth = map(float, words[at + 1].split(","))
        del words[at : at + 2]
    relt = str(Path(words[0] if words else ROOT / "target/release/relt").resolve())
    with_mpi = str(Path(words[1]).resolve()) if len(words) > 1 else relt
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def cost(*options):
            return run(relt, folder, "--threads", "1", *options)

        # a + m·b: what a run costs before its first mutation, and what a mutation costs
        print("Processor seconds of runs with K replicas and M mutations: a + M b(K), b(K) = b∞ + (b₂ − b∞) · 2/K\n")
        replicas = ["--replicas", "4"]
        short, long = cost("--mpp", "50", *replicas), cost("--mpp", "400", *replicas)
        start, each = line([short["mutations"], long["mutations"]], [short["cpu_seconds"], long["cpu_seconds"]])
        start = max(start, 0.0)
        per = {4: each}
        for k in (2, 16):
            end = cost("--mpp", "200", "--replicas", str(k))
            per[k] = (end["cpu_seconds"] - start) / end["mutations"]
        base, slope = line([2 / k for k in per], list(per.values()))
        print(f"a = {start:.2f} s, b(2) = {1e6 * per[2]:.2f} µs, b(4) = {1e6 * per[4]:.2f} µs, b(16) = {1e6 * per[16]:.2f} µs\n")
        model = lambda k, mutations: start + mutations * (base + slope * 2 / k)
        rows = []
        for k in (2, 3, 8, 32, 64):
            end = cost("--mpp", "120", "--replicas", str(k))
            rows.append((f"K = {k}, one thread, 120 mpp (s)", end["cpu_seconds"], model(k, end["mutations"])))
        end = run(relt, folder, "--threads", "2", "--mpp", "200", *replicas)
        rows.append(("two threads, 200 mpp (s of both)", end["cpu_seconds"], model(4, end["mutations"])))
        for parts in (2, 4):
            ends = [cost("--mpp", "300", "--part", f"{i}/{parts}", *replicas) for i in range(1, parts + 1)]
            for path in folder.glob("run.*.part*"):
                path.unlink()
            cpu, mutations = sum(end["cpu_seconds"] for end in ends), sum(end["mutations"] for end in ends)
            rows.append((f"{parts} parts, 300 mpp (s of all)", cpu, parts * start + (model(4, mutations) - start)))
        compared(rows)

        told = talk_of_ranks(with_mpi, folder)

        predict(start, base + slope * 2 / 4, told, latency, bandwidth)


if __name__ == "__main__":
    main()
