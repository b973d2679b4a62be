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
import os
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
FEWEST_BLOCKS = 8
RUNGS = 4096  # of all blocks together, where that leaves eight (src/tempering/sampler/mod.rs)
LANES = 16  # of the ladders of a block, unless one ladder has more
AGE = 1.5e-6  # MB for the sweeps that a replica was on a rung: numbers of one byte or two
POINT = 400  # bytes of an offered point, with what it contributes
UNIFORM = 0.1  # share of uniform points, at least


def shape(k, most=BLOCKS):
    """Blocks of a large job with K replicas, and ladders of each."""
    return min(max(RUNGS // k, FEWEST_BLOCKS), most) & ~1, max(LANES // max(2 * (k - 1), 1), 1)


def run(relt, folder, *options, before=()):
    """Runs; what the log's last line says, and what was said of ranks."""
    log = folder / "run.jsonl"
    log.unlink(missing_ok=True)
    command = [*before, relt, "render", SCENE, *BASE, *options, "-o", "run.exr", "--log", "run.jsonl"]
    with open(folder / "told", "w+") as told:
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=told)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        told.seek(0)
        said = told.read()
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(command)}: {said}")
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    end = lines[-1]
    end["peak"] = usage.ru_maxrss / 1024  # MB
    rounds = [line for line in lines if line["event"] == "round"]
    end["rounds"] = len(rounds)
    # of all evaluations, by the shares of the rounds
    before, uniform = 0, 0.0
    for one in rounds + [{"mutations": end["mutations"], "uniform_share": rounds[-1]["uniform_share"] if rounds else 1.0}]:
        uniform += (one["mutations"] - before) * one["uniform_share"]
        before = one["mutations"]
    end["uniform"] = uniform / max(before, 1)
    found = re.search(r"in (\d+) exchanges of ([\d.]+) MB", said)
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

    # of all blocks, those elsewhere tell t₀ + t₁ K a round; film and probes are in t₀; how long each replica of each ladder was
    # on each rung is t₂ K²
    print("Bytes that rank 0 hears: (1 − 1/n) · rounds · (t₀ + t₁ K + t₂ K²)\n")
    first, second = ranks(2, 4), ranks(2, 16)
    share = lambda end, n: end["megabytes"] / (end["rounds"] + 1) / (1 - 1 / n)
    t0, t1 = line([4, 16], [share(first, 2), share(second, 2)])
    hears = lambda k: t0 + t1 * k + FEWEST_BLOCKS * AGE * k * k
    rows = []
    for n, k in ((3, 4), (4, 4), (2, 8), (2, 32), (5, 16), (2, 128), (2, 512)):
        end = ranks(n, k)
        rows.append((f"{n} ranks, K = {k} (MB)", end["megabytes"], (1 - 1 / n) * (end["rounds"] + 1) * hears(k)))
    compared(rows)
    print("Exchanges of rank 0 where two ranks share some of the eight blocks: one a sweep more than on 2 ranks\n")
    rows = []
    for k in (16, 64, 256):
        few, many = ranks(2, k), ranks(12, k)
        blocks, ladders = shape(k, FEWEST_BLOCKS)
        share = 1 - many["uniform"]
        sweeps = share * many["mutations"] / (blocks * ladders * (k - 1))
        rows.append((f"12 ranks, K = {k}", many["exchanges"], few["exchanges"] + sweeps))
    compared(rows)
    print(f"t₀ + t₁ K + t₂ K² = {t0:.2f} + {t1:.3f} K + {FEWEST_BLOCKS * AGE:.1e} K² MB a round, {first['exchanges']} exchanges in all\n")
    return t0, t1, first["rounds"]


def memory_of(relt, folder):
    """Fits and checks what a process takes: m₀ + m₁ R MB with R rungs of all blocks together."""
    print("Most memory of a process: m₀ + m₁ R, R = blocks · K\n")
    peak = lambda k: run(relt, folder, "--threads", "1", "--mpp", "60", "--replicas", str(k))["peak"]
    rungs = lambda k: shape(k, FEWEST_BLOCKS)[0] * k
    least, each = line([rungs(k) for k in (4, 256)], [peak(k) for k in (4, 256)])
    compared([(f"K = {k}, R = {rungs(k)} (MB)", peak(k), least + each * rungs(k)) for k in (32, 128, 512, 1024)])
    print(f"m₀ = {least:.0f} MB, m₁ = {1000 * each:.1f} kB\n")
    return least, each


def predict(start, each, told, memory, latency, bandwidth):
    """Prints what a large run is to take: `start` in seconds a run, `each` in seconds a mutation by K, `told` and `memory` as
    they were fitted."""
    print("Predicted for a network of %g µs and %g GB/s, a picture of 10¹⁰ mutations:\n" % (1e6 * latency, bandwidth / 1e9))
    print("| cores | K | as | replicas | compute (s) | start (s) | talk (s) | efficiency | a rank's memory (MB) |")
    print("|---|---|---|---|---|---|---|---|---|")
    for k in (4, 64, 1024):
        blocks, ladders = shape(k)
        work = 1e10 * each(k)
        wanted = math.ceil(1e5 / (blocks * ladders * k))  # parts that have 10⁵ replicas together
        for cores in (1, 64, 1000):
            # as one run, with a rank for each block, so many that there are 10⁵ replicas, each core for itself
            full = max(cores // blocks, 1)
            ways = {(1, cores), (full, min(cores // full, blocks)), (cores, 1)}
            for parts, ranks in sorted(ways | ({(wanted, cores // wanted)} if wanted <= cores == 1000 else set())):
                if ranks > 1 and told is None:
                    continue
                print(row(k, cores, parts, ranks, work, start, told, memory, latency, bandwidth))


def row(k, cores, parts, ranks, work, start, told, memory, latency, bandwidth):
    blocks, ladders = shape(k)
    compute = work / parts / min(ranks, blocks) * math.ceil(blocks / ranks) * min(ranks, blocks) / blocks
    group = ranks / blocks  # ranks that share a block, where that is more than one
    if group > 1:
        compute = work / parts / blocks / math.floor(group)  # blocks of fewer ranks are waited for
    talk = 0.0
    if ranks > 1:
        rounds = told[2] + math.log2(max(work / parts / (start + 1), 1))
        megabytes = told[0] + blocks / FEWEST_BLOCKS * told[1] * k + blocks * ladders * AGE * k * k
        steps = math.ceil(math.log2(ranks))
        talk = rounds * (steps * latency + 1e6 * megabytes / bandwidth)
        talk += compute / 0.2 * 2 * steps * latency  # an order a slice
    if group > 1:
        # to the first of the group and back, a length and bytes each time
        sweeps = (1 - UNIFORM) * 1e10 / parts / (blocks * ladders * k)
        others = math.ceil(group) - 1
        talk += sweeps * others * (4 * latency + ladders * (8 * k + POINT) / bandwidth)
    efficiency = work / cores / (compute + start + talk)
    replicas = parts * blocks * ladders * k
    megabytes = memory[0] + memory[1] * blocks * k
    what = f"{parts} parts × {ranks} ranks"
    return f"| {cores} | {k} | {what} | {replicas} | {compute:.1f} | {start:.2f} | {talk:.3g} | {efficiency:.2f} | {megabytes:.0f} |"


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
        for k in (2, 3, 8, 32, 64, 256):
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

        memory = memory_of(relt, folder)

        predict(start, lambda k: base + slope * 2 / k, told, memory, latency, bandwidth)


if __name__ == "__main__":
    main()
