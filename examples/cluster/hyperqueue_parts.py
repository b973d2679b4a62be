"""A job in parts as tasks of HyperQueue by its Python API (`pip install hyperqueue`): task 0 looks whether the scene can be
read, tasks 1 to N are the parts, and a last one merges them.

    hyperqueue_parts.py SERVER_DIR N scene.xml image.exr --mpp 65536

Submitted again, parts go on where they were; those that are done return at once.
"""

import os
import sys
from pathlib import Path

from hyperqueue import Client, Job
from hyperqueue.ffi.protocol import ResourceRequest


def main() -> int:
    server, parts, scene, image, *options = sys.argv[1:]
    relt, cores = os.environ.get("RELT", "relt"), int(os.environ.get("CORES", "1"))
    here, output = Path.cwd(), Path(image)
    job = Job(default_workdir=here, max_fails=None)
    log = lambda name: str(here / f"{output.stem}.{name}.log")
    looked = job.program([relt, "info", scene], name="info", stdout=log("info"), stderr=log("info-errors"))
    render = [relt, "render", scene, "-o", image, "--part", f"hq/{parts}", "--resume", "auto"]
    render += ["--checkpoint", os.environ.get("CHECKPOINT", "10m"), *options]
    tasks = [
        job.program(
            render,
            name=f"part {part}",
            deps=[looked],
            resources=ResourceRequest(cpus=cores),
            stdout=log(f"{part}-output"),
            stderr=log(str(part)),
            crash_limit=10,
        )
        for part in range(1, int(parts) + 1)
    ]
    files = [str(output.with_suffix(f".{part}-of-{parts}.part")) for part in range(1, int(parts) + 1)]
    job.program([relt, "merge", *files, "-o", image], name="merge", deps=tasks, stdout=log("merge"), stderr=log("merge-errors"))
    client = Client(server)
    submitted = client.submit(job)
    return 0 if client.wait_for_jobs([submitted], raise_on_error=False) else 1


if __name__ == "__main__":
    sys.exit(main())
